#include "server/journal/turns.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace stellate::server {
namespace {

using Place = Turns::Place;

TEST(Turns, ComeInTheOrderOfArrivalButFirstToThoseInAHurry) {
  Turns turns;
  std::vector<int> order;  // under the turn
  std::vector<std::thread> threads;
  {
    const Turn held(turns, Place::kLast);
    const std::vector<Place> places{Place::kLast, Place::kLast, Place::kFirst, Place::kLast,
                                    Place::kFirst};
    for (std::size_t i = 0; i < places.size(); ++i) {
      threads.emplace_back([&turns, &order, i, place = places[i]] {
        const Turn turn(turns, place);
        order.push_back(static_cast<int>(i));
      });
      while (turns.waiting() <= i) std::this_thread::yield();
    }
    EXPECT_TRUE(order.empty());
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<int>{2, 4, 0, 1, 3}));
  EXPECT_EQ(turns.waiting(), 0u);
  const Turn again(turns, Place::kFirst);  // free once everybody had it
}

// One that takes it again and again lets in everybody who waits.
TEST(Turns, AreNotTakenOutOfTurn) {
  Turns turns;
  turns.Take(Place::kLast);
  bool had = false;  // under the turn
  std::thread other([&] {
    const Turn turn(turns, Place::kLast);
    had = true;
  });
  while (turns.waiting() == 0) std::this_thread::yield();
  turns.Give();
  {
    const Turn turn(turns, Place::kFirst);
    EXPECT_TRUE(had) << "it was promised before anybody asked again";
  }
  other.join();
}

TEST(Turns, AreOneAtATime) {
  Turns turns;
  int count = 0;
  std::vector<std::thread> threads;
  for (const Place place : {Place::kLast, Place::kFirst, Place::kLast}) {
    threads.emplace_back([&turns, &count, place] {
      for (int i = 0; i < 2000; ++i) {
        const Turn turn(turns, place);
        ++count;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(count, 6000);
}

}  // namespace
}  // namespace stellate::server
