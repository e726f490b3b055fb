#include "core/index/ball_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/random.h"

namespace stellate::core {
namespace {

using Ids = std::vector<std::uint32_t>;

// A tree with the plain list of all it should know beside it.
class BallTreeTest : public ::testing::TestWithParam<int> {
 protected:
  BallTreeTest() : d_(GetParam()), random_(77, static_cast<std::uint64_t>(GetParam())) {}

  // Points lie in the unit cube and, every third, in a small cluster: leaves of all sizes.
  std::vector<double> Draw() {
    const bool clustered = random_.Next() % 3 == 0;
    std::vector<double> x(static_cast<std::size_t>(d_));
    for (double& c : x) c = clustered ? 0.25 + 0.01 * random_.Uniform() : random_.Uniform();
    return x;
  }

  double DrawInfluence() { return random_.Uniform() * 0.3 * std::sqrt(d_); }

  void Insert(const std::vector<double>& x, double influence) {
    coordinates_.insert(coordinates_.end(), x.begin(), x.end());
    influence_.push_back(influence);
    tree_.Insert(influence);
  }

  void SetInfluence(std::uint32_t id, double influence) {
    influence_[id] = influence;
    tree_.SetInfluence(id, influence);
  }

  double SquaredDistanceTo(std::uint32_t id, const std::vector<double>& q) const {
    return SquaredDistance(q.data(), coordinates_.data() + id * q.size(), d_);
  }

  template <typename Keep>
  Ids All(Keep&& keep) const {
    Ids ids;
    for (std::uint32_t id = 0; id < influence_.size(); ++id)
      if (keep(id)) ids.push_back(id);
    return ids;
  }

  void CheckQueriesFrom(const std::vector<double>& q) {
    for (const double radius : {0.0, 0.1, 0.4, 2.0})
      EXPECT_EQ(tree_.AnyWithin(q.data(), radius), !All([&](std::uint32_t id) {
                                                      return SquaredDistanceTo(id, q) <=
                                                             radius * radius;
                                                    }).empty());
    Ids got;
    tree_.ForEachInfluencing(q.data(), [&](std::uint32_t id) { got.push_back(id); });
    std::sort(got.begin(), got.end());
    EXPECT_EQ(got, All([&](std::uint32_t id) {
                return SquaredDistanceTo(id, q) < influence_[id] * influence_[id];
              }));

    const double radius = DrawInfluence();
    got.clear();
    tree_.VisitNear(
        q.data(), [&] { return radius; },
        [&](std::uint32_t id, double d2) {
          EXPECT_EQ(d2, SquaredDistanceTo(id, q));
          got.push_back(id);
        });
    std::sort(got.begin(), got.end());
    EXPECT_EQ(got,
              All([&](std::uint32_t id) { return SquaredDistanceTo(id, q) <= radius * radius; }));

    got.clear();
    tree_.Gather(q.data(), radius, &got);
    std::sort(got.begin(), got.end());
    EXPECT_EQ(got, All([&](std::uint32_t id) {
                return std::sqrt(SquaredDistanceTo(id, q)) <= radius + influence_[id];
              }));

    double nearest = INFINITY;
    for (std::uint32_t id = 0; id < influence_.size(); ++id)
      nearest = std::min(nearest, SquaredDistanceTo(id, q));
    EXPECT_EQ(NearestSquaredDistance(tree_, q.data()), nearest);
  }

  void CheckQueries(int count) {
    ASSERT_EQ(tree_.size(), influence_.size());
    for (int i = 0; i < count; ++i) CheckQueriesFrom(Draw());
    for (int i = 0; i < count && !influence_.empty(); ++i) {
      const auto at = static_cast<std::ptrdiff_t>(random_.Next() % influence_.size()) * d_;
      CheckQueriesFrom({coordinates_.begin() + at, coordinates_.begin() + at + d_});
    }
  }

  int d_;
  Random random_;
  std::vector<double> coordinates_, influence_;
  BallTree tree_{d_, &coordinates_};
};

TEST_P(BallTreeTest, KnowsNothingWhenEmpty) {
  const std::vector<double> q = Draw();
  tree_.ForEachInfluencing(q.data(), [](std::uint32_t) { FAIL(); });
  tree_.VisitNear(
      q.data(), [] { return 1e9; }, [](std::uint32_t, double) { FAIL(); });
  EXPECT_EQ(NearestSquaredDistance(tree_, q.data()), INFINITY);
  EXPECT_EQ(tree_.size(), 0u);
}

TEST_P(BallTreeTest, AnswersAsAListWouldWhileItGrows) {
  for (int n = 1; n <= 900; ++n) {
    Insert(Draw(), DrawInfluence());
    if (n < 40 || n % 50 == 0) CheckQueries(n < 40 ? 2 : 15);
  }
}

TEST_P(BallTreeTest, AnswersTheSameWhenGivenAllPointsAtOnce) {
  for (const int n : {1, 2, 8, 9, 100, 777, 40000}) {
    coordinates_.clear();
    influence_.clear();
    for (int i = 0; i < n; ++i) {
      const std::vector<double> p = Draw();
      coordinates_.insert(coordinates_.end(), p.begin(), p.end());
      influence_.push_back(DrawInfluence());
    }
    tree_.Assign(influence_, BallTree::Halving::kExtent);
    CheckQueries(n < 1000 ? 15 : 3);
    tree_.Assign(influence_);
    CheckQueries(n < 1000 ? 15 : 3);
    for (int i = 0; i < 20; ++i) Insert(Draw(), DrawInfluence());  // and it still grows
    CheckQueries(5);
  }
  coordinates_.clear();
  influence_.clear();
  tree_.Assign({});
  EXPECT_EQ(tree_.size(), 0u);
  EXPECT_EQ(NearestSquaredDistance(tree_, Draw().data()), INFINITY);
}

TEST_P(BallTreeTest, TakesAllInfluencesAnew) {
  for (int n = 0; n < 600; ++n) Insert(Draw(), DrawInfluence());
  for (const double share : {2.0, 0.3}) {
    for (double& influence : influence_) influence = share * DrawInfluence();
    tree_.SetInfluences(influence_);
    CheckQueries(15);
    SetInfluence(7, 0.9);
    tree_.Refit();
    CheckQueries(5);
  }
}

TEST_P(BallTreeTest, HasEveryPointInOneBunch) {
  EXPECT_TRUE(tree_.Bunches().empty());
  for (int n = 0; n < 700; ++n) Insert(Draw(), 0);
  std::vector<int> times(700, 0);
  for (const BallTree::Bunch& bunch : tree_.Bunches())
    for (std::uint32_t i = 0; i < bunch.count; ++i) {
      const std::uint32_t id = bunch.ids[i];
      ++times[id];
      EXPECT_LE(Distance(bunch.centre, coordinates_.data() + id * static_cast<std::size_t>(d_), d_),
                bunch.radius * (1 + 1e-12));
    }
  EXPECT_EQ(times, std::vector<int>(700, 1));
}

// Half of the points lie in one place, and each other one twice as far as the one before.
TEST_P(BallTreeTest, StaysFlatWhateverTheExtents) {
  for (int i = 0; i < 2000; ++i) {
    std::vector<double> x(static_cast<std::size_t>(d_), 0.0);
    if (i % 2 == 1) x[0] = std::ldexp(1.0, -(i / 2) % 900);
    coordinates_.insert(coordinates_.end(), x.begin(), x.end());
    influence_.push_back(0);
  }
  tree_.Assign(influence_);
  CheckQueries(5);
}

// Points of one place are few, and on the whole much nearer to each other than any two.
TEST_P(BallTreeTest, PlacesKeepNearPointsTogether) {
  constexpr std::uint32_t kCount = 2000;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    const std::vector<double> p = Draw();
    coordinates_.insert(coordinates_.end(), p.begin(), p.end());
    influence_.push_back(0);
  }
  tree_.Assign(influence_);
  Ids order = All([](std::uint32_t) { return true; });
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(tree_.PlaceOf(a), a) < std::pair(tree_.PlaceOf(b), b);
  });
  const auto tour = [&](const Ids& ids) {
    double length = 0;
    for (std::size_t i = 1; i < ids.size(); ++i) {
      const double* p = coordinates_.data() + ids[i - 1] * static_cast<std::size_t>(d_);
      length += std::sqrt(SquaredDistanceTo(ids[i], {p, p + d_}));
    }
    return length;
  };
  EXPECT_LT(tour(order), 0.9 * tour(All([](std::uint32_t) { return true; })));
}

TEST_P(BallTreeTest, TakesPointsInSortedOrder) {
  for (int n = 0; n < 600; ++n) {
    std::vector<double> x(static_cast<std::size_t>(d_), 0.0);
    x[0] = n / 600.0;
    Insert(x, DrawInfluence());
  }
  CheckQueries(40);
}

TEST_P(BallTreeTest, FollowsInfluencesUpAndDown) {
  for (int n = 0; n < 500; ++n) Insert(Draw(), 0);
  CheckQueries(10);
  for (int round = 0; round < 12; ++round) {
    for (int i = 0; i < 150; ++i)
      SetInfluence(static_cast<std::uint32_t>(random_.Next() % influence_.size()),
                   random_.Next() % 4 == 0 ? 0 : DrawInfluence());
    CheckQueries(8);  // shrinking needs no Refit to be right
    if (round % 2 == 0) tree_.Refit();
    CheckQueries(8);
    for (int i = 0; i < 60; ++i) Insert(Draw(), DrawInfluence());
    CheckQueries(8);
    tree_.Refit();
    tree_.Refit();
    CheckQueries(8);
  }
  for (std::uint32_t id = 0; id < influence_.size(); ++id) SetInfluence(id, 0);
  tree_.Refit();
  CheckQueries(10);
}

TEST_P(BallTreeTest, HoldsAnyNumberOfPointsInOnePlace) {
  const std::vector<double> x = Draw();
  for (int n = 0; n < 200; ++n) Insert(x, n % 3 == 0 ? DrawInfluence() : 0);
  CheckQueries(10);
  for (int n = 0; n < 200; ++n) Insert(n % 2 == 0 ? x : Draw(), DrawInfluence());
  CheckQueries(20);
  Ids here;
  tree_.VisitNear(
      x.data(), [] { return 0.0; }, [&](std::uint32_t id, double) { here.push_back(id); });
  EXPECT_GE(here.size(), 300u);
}

TEST_P(BallTreeTest, AsksForTheRadiusAsItShrinks) {
  for (int n = 0; n < 2000; ++n) Insert(Draw(), 0);
  // The three nearest, by a radius that shrinks to the third nearest seen.
  for (int i = 0; i < 20; ++i) {
    const std::vector<double> q = Draw();
    std::vector<double> best;
    int visits = 0;
    tree_.VisitNear(
        q.data(), [&] { return best.size() < 3 ? INFINITY : std::sqrt(best[2]); },
        [&](std::uint32_t, double d2) {
          ++visits;
          best.push_back(d2);
          std::sort(best.begin(), best.end());
          if (best.size() > 3) best.resize(3);
        });
    std::vector<double> expected;
    for (std::uint32_t id = 0; id < influence_.size(); ++id)
      expected.push_back(SquaredDistanceTo(id, q));
    std::sort(expected.begin(), expected.end());
    expected.resize(3);
    EXPECT_EQ(best, expected);
    if (d_ <= 3) {
      EXPECT_LT(visits, 400);  // near ones come first: most are never visited
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Dimensions, BallTreeTest, ::testing::Values(2, 3, 30));

}  // namespace
}  // namespace stellate::core
