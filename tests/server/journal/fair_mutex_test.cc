#include "server/journal/fair_mutex.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

namespace stellate::server {
namespace {

using Queue = FairMutex::Place;

TEST(FairMutex, ComeInTheOrderOfArrivalButFirstToThoseInAHurry) {
  FairMutex mutex;
  std::vector<int> order;  // under the turn
  std::vector<std::thread> threads;
  {
    const FairLock held(mutex, Queue::kLast);
    const std::vector<Queue> places{Queue::kLast, Queue::kLast, Queue::kFirst, Queue::kLast,
                                    Queue::kFirst};
    for (std::size_t i = 0; i < places.size(); ++i) {
      threads.emplace_back([&mutex, &order, i, place = places[i]] {
        const FairLock turn(mutex, place);
        order.push_back(static_cast<int>(i));
      });
      while (mutex.waiting() <= i) std::this_thread::yield();
    }
    EXPECT_TRUE(order.empty());
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<int>{2, 4, 0, 1, 3}));
  EXPECT_EQ(mutex.waiting(), 0u);
  const FairLock again(mutex, Queue::kFirst);  // free once everybody had it
}

// One that takes it again and again lets in everybody who waits.
TEST(FairMutex, AreNotTakenOutOfTurn) {
  FairMutex mutex;
  mutex.Lock(Queue::kLast);
  bool had = false;  // under the turn
  std::thread other([&] {
    const FairLock turn(mutex, Queue::kLast);
    had = true;
  });
  while (mutex.waiting() == 0) std::this_thread::yield();
  mutex.Unlock();
  {
    const FairLock turn(mutex, Queue::kFirst);
    EXPECT_TRUE(had) << "it was promised before anybody asked again";
  }
  other.join();
}

TEST(FairMutex, AreOneAtATime) {
  FairMutex mutex;
  int count = 0;
  std::vector<std::thread> threads;
  for (const Queue place : {Queue::kLast, Queue::kFirst, Queue::kLast}) {
    threads.emplace_back([&mutex, &count, place] {
      for (int i = 0; i < 2000; ++i) {
        const FairLock turn(mutex, place);
        ++count;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(count, 6000);
}

}  // namespace
}  // namespace stellate::server
