#include "server/turns/fair_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

namespace stellate::server::testing {
namespace {

// Owners that always want another turn, each of which costs 1.
class Crowd {
 public:
  void Join(const std::string& owner, double weight) {
    weights_[owner] = weight;
    Ask(owner);
  }
  void Weigh(const std::string& owner, double weight) { weights_[owner] = weight; }

  // Whose turns come next.
  std::vector<std::string> Take(int turns) {
    std::vector<std::string> taken;
    for (int turn = 0; turn < turns; ++turn) {
      const std::string owner = asked_.at(queue_.Next().value());
      taken.push_back(owner);
      queue_.Charge(owner, 1 / weights_.at(owner));
      Ask(owner);
    }
    return taken;
  }
  std::map<std::string, int> Count(int turns) {
    std::map<std::string, int> counts;
    for (const std::string& owner : Take(turns)) ++counts[owner];
    return counts;
  }
  FairQueue& queue() { return queue_; }

 private:
  void Ask(const std::string& owner) { asked_[queue_.Ask(owner)] = owner; }

  FairQueue queue_;
  std::map<std::string, double> weights_;
  std::map<FairQueue::Ticket, std::string> asked_;
};

TEST(FairQueue, TurnsAreTakenByWeight) {
  Crowd crowd;
  crowd.Join("ada", 3);
  crowd.Join("ben", 1);
  auto counts = crowd.Count(400);
  EXPECT_NEAR(counts["ada"], 300, 1);
  EXPECT_NEAR(counts["ben"], 100, 1);
  crowd.Weigh("ben", 9);
  counts = crowd.Count(400);
  EXPECT_NEAR(counts["ada"], 100, 3);
  EXPECT_NEAR(counts["ben"], 300, 3);
}

TEST(FairQueue, ManyMeshesOfAnOwnerHaveNoMoreThanOne) {
  Crowd crowd;
  for (int mesh = 0; mesh < 30; ++mesh) crowd.Join("ada", 1);
  crowd.Join("ben", 1);
  auto counts = crowd.Count(200);
  EXPECT_NEAR(counts["ada"], 100, 1);
  EXPECT_NEAR(counts["ben"], 100, 1);
}

TEST(FairQueue, NobodyStarves) {
  Crowd crowd;
  crowd.Join("ada", 1000);
  crowd.Join("ben", 1000);
  crowd.Join("cleo", 1);
  const auto taken = crowd.Take(20'000);
  int waited = 0, longest = 0;
  for (const std::string& owner : taken) {
    waited = owner == "cleo" ? 0 : waited + 1;
    longest = std::max(longest, waited);
  }
  EXPECT_LE(longest, 2002);
}

TEST(FairQueue, WhoWasIdleHasSavedUpNothing) {
  Crowd crowd;
  crowd.Join("ada", 1);
  crowd.Take(1000);
  crowd.Join("ben", 1);
  auto counts = crowd.Count(100);
  EXPECT_NEAR(counts["ada"], 50, 1);
  EXPECT_NEAR(counts["ben"], 50, 1);
}

TEST(FairQueue, WhoComesBackOwesWhatHeHad) {
  FairQueue queue;
  const auto first = queue.Ask("ada");
  const auto second = queue.Ask("ben");
  ASSERT_EQ(queue.Next(), first);
  queue.Charge("ada", 5);  // a long turn, and gone for a moment
  ASSERT_EQ(queue.Next(), second);
  queue.Charge("ben", 1);
  const auto again = queue.Ask("ada");
  for (int turn = 0; turn < 4; ++turn) {
    const auto ticket = queue.Ask("ben");
    EXPECT_EQ(queue.Next(), ticket) << turn;
    queue.Charge("ben", 1);
  }
  queue.Ask("ben");
  EXPECT_EQ(queue.Next(), again);
}

TEST(FairQueue, AnOwnersTurnsAreInOrderAndCanBeTakenBack) {
  FairQueue queue;
  const auto first = queue.Ask("ada");
  const auto second = queue.Ask("ada");
  const auto third = queue.Ask("ada");
  EXPECT_TRUE(queue.TakeBack("ada", second));
  EXPECT_FALSE(queue.TakeBack("ada", second));
  EXPECT_FALSE(queue.TakeBack("ben", third));
  EXPECT_EQ(queue.Next(), first);
  EXPECT_EQ(queue.Next(), third);
  EXPECT_FALSE(queue.TakeBack("ada", third));
  EXPECT_EQ(queue.Next(), std::nullopt);
  EXPECT_TRUE(queue.empty());
}

TEST(FairQueue, OwnersWhoAreGoneAreForgotten) {
  FairQueue queue;
  for (int i = 0; i < 1000; ++i) {
    const std::string owner = "owner" + std::to_string(i);
    queue.Ask(owner);
    queue.Next();
    queue.Charge(owner, 1);
    queue.Ask("ada");
    queue.Next();
    queue.Charge("ada", 2);
  }
  EXPECT_LE(queue.owners(), 3u);
}

}  // namespace
}  // namespace stellate::server::testing
