#include "core/sampling/growth.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <vector>

#include "core/base/basis_layout.h"
#include "core/sampling/lattice.h"
#include "stellate/catalogue.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::Make;

// Closest points with tangent bases by vector, and all found unless `change` says otherwise.
struct Answered {
  Eigen::MatrixXd points, tangents;
  std::vector<std::uint8_t> found;
};
using Change = std::function<void(Answered*)>;

Answered Closest(Manifold& manifold, const Eigen::MatrixXd& x, const Change& change) {
  Answer answer = manifold.ClosestPoint(x);
  const int d = manifold.ambient_dimension(), k = manifold.dimension();
  if (answer.tangents.size() == 0) answer.tangents = manifold.TangentBasis(answer.points);
  Answered all{answer.points, Eigen::MatrixXd(d * k, x.cols()),
               std::vector<std::uint8_t>(static_cast<std::size_t>(x.cols()), 1)};
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    ToByVector(answer.tangents.col(c).data(), d, k, all.tangents.col(c).data());
  if (change) change(&all);
  return all;
}

// A sample grown from `seeds`, a column each.
template <int K>
Eigen::MatrixXd Grow(Manifold& manifold, double spacing, const Eigen::MatrixXd& seeds, double apart,
                     const Change& change = {}, int most_rounds = 200) {
  Growth<K> growth(manifold.ambient_dimension(), spacing);
  std::vector<Eigen::VectorXd> sample;
  const auto add = [&](const Answered& from, const std::vector<Eigen::Index>& columns) {
    for (const Eigen::Index c : columns) sample.push_back(from.points.col(c));
  };
  const Answered begun = Closest(manifold, seeds, {});
  add(begun, growth.Begin(begun.points, begun.tangents, begun.found, apart));
  for (int round = 0; round < most_rounds; ++round) {
    const auto ring = growth.Propose();
    if (ring.points.cols() == 0) break;
    const Answered answered = Closest(manifold, ring.points, change);
    add(answered, growth.Join(answered.points, answered.tangents, answered.found));
  }
  EXPECT_EQ(growth.size(), sample.size());
  Eigen::MatrixXd all(manifold.ambient_dimension(), static_cast<Eigen::Index>(sample.size()));
  for (std::size_t i = 0; i < sample.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = sample[i];
  return all;
}

double LeastDistance(const Eigen::MatrixXd& x) {
  double least = INFINITY;
  for (Eigen::Index i = 0; i < x.cols(); ++i)
    for (Eigen::Index j = 0; j < i; ++j) least = std::min(least, (x.col(i) - x.col(j)).norm());
  return least;
}

// The largest distance from points of M to the sample.
double FarthestFrom(const Eigen::MatrixXd& sample, Manifold& manifold) {
  const auto box = *manifold.bounding_box();
  std::srand(3);
  Eigen::MatrixXd x = Eigen::MatrixXd::Random(manifold.ambient_dimension(), 1000);
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    x.col(c) = 0.5 * ((box.upper + box.lower).array() +
                      (box.upper - box.lower).array() * x.col(c).array());
  const Eigen::MatrixXd y = manifold.ClosestPoint(x).points;
  double most = 0;
  for (Eigen::Index c = 0; c < y.cols(); ++c)
    most = std::max(most, (sample.colwise() - y.col(c)).colwise().norm().minCoeff());
  return most;
}

TEST(Growth, CoversASphereFromOneSeedAndKeepsItsDistance) {
  const auto sphere = Make("sphere:2");
  const double spacing = 0.12;
  const Eigen::MatrixXd sample = Grow<2>(*sphere, spacing, Eigen::Vector3d(0, 0, 2), 1);
  EXPECT_GE(LeastDistance(sample), Growth<2>::kKeep * spacing);
  EXPECT_LE(FarthestFrom(sample, *sphere), spacing);
  // The lattice would have 4 pi / (spacing^2 sin 60); patches that meet cost some more.
  const double lattice = 4 * std::numbers::pi / (spacing * spacing * std::sqrt(0.75));
  EXPECT_GE(static_cast<double>(sample.cols()), 0.95 * lattice);
  EXPECT_LE(static_cast<double>(sample.cols()), 1.25 * lattice);
}

TEST(Growth, CoversACurveAndAThreeSphere) {
  const auto knot = Make("torus-knot:2:3");
  const Eigen::MatrixXd curve =
      Grow<1>(*knot, 0.1, knot->ClosestPoint(Eigen::Vector3d(3, 0, 0)).points, 1);
  EXPECT_GE(LeastDistance(curve), Growth<1>::kKeep * 0.1);
  EXPECT_LE(FarthestFrom(curve, *knot), 0.1);
  const auto sphere = Make("sphere:3");
  const Eigen::MatrixXd sample = Grow<3>(*sphere, 0.4, Eigen::Vector4d(1, 0, 0, 0), 1);
  EXPECT_GE(LeastDistance(sample), Growth<3>::kKeep * 0.4);
  EXPECT_LE(FarthestFrom(sample, *sphere), 0.4);
}

// A patch in the plane is the lattice itself.
TEST(Growth, IsTheLatticeWhereNothingBends) {
  const int d = 3;
  Growth<2> growth(d, 1);
  const Eigen::Matrix<double, 6, 1> frame{1, 0, 0, 0, 1, 0};
  ASSERT_EQ(growth.Begin(Eigen::Vector3d(0, 0, 0), frame, {1}, 5).size(), 1u);
  const std::size_t rings[] = {6, 12, 18, 24};
  for (const std::size_t count : rings) {
    const auto ring = growth.Propose();
    ASSERT_EQ(ring.points.cols(), static_cast<Eigen::Index>(count));
    EXPECT_LT(ring.points.row(2).cwiseAbs().maxCoeff(), 1e-12);
    const Eigen::MatrixXd tangents = frame.replicate(1, ring.points.cols());
    EXPECT_EQ(growth.Join(ring.points, tangents, std::vector<std::uint8_t>(count, 1)).size(),
              count);
  }
}

// Grown with a share of the spacing at each point; also how many points were asked for.
struct Graded {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> shares;
  Eigen::Index asked = 0;
};

Graded GrowGraded(double spacing, const std::function<double(const Eigen::Vector3d&)>& share) {
  const auto sphere = Make("sphere:2");
  Growth<2> growth(3, spacing);
  Graded all;
  const auto shares_of = [&](const Answered& from) {
    Eigen::VectorXd shares(from.points.cols());
    for (Eigen::Index c = 0; c < shares.size(); ++c) shares[c] = share(from.points.col(c));
    return shares;
  };
  const auto add = [&](const Answered& from, const std::vector<Eigen::Index>& columns) {
    for (const Eigen::Index c : columns) {
      all.points.push_back(from.points.col(c));
      all.shares.push_back(share(all.points.back()));
    }
  };
  const Answered begun = Closest(*sphere, Eigen::Vector3d(0, 0, 2), {});
  add(begun, growth.Begin(begun.points, begun.tangents, begun.found, 1, shares_of(begun)));
  for (int round = 0; round < 500; ++round) {
    const auto ring = growth.Propose();
    if (ring.points.cols() == 0) break;
    const Answered answered = Closest(*sphere, ring.points, {});
    add(answered,
        growth.Join(answered.points, answered.tangents, answered.found, shares_of(answered)));
    all.asked += ring.points.cols();
  }
  return all;
}

// From the one pole to the other spacings grow eightfold.
TEST(Growth, KeepsItsDistanceAndCoversWhereSizesAreGraded) {
  const double spacing = 0.16;
  const auto share = [](const Eigen::Vector3d& y) { return std::exp2(-1.5 * (1 - y[2])); };
  const Graded grown = GrowGraded(spacing, share);
  double lattice = 0;
  for (std::size_t i = 0; i < grown.points.size(); ++i) {
    const double own = spacing * grown.shares[i];
    lattice += own * own * std::sqrt(0.75);
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_GE((grown.points[i] - grown.points[j]).norm(),
                Growth<2>::kKeep * spacing * std::min(grown.shares[i], grown.shares[j]));
  }
  // Cells of the lattice, each of its own spacing, would tile the sphere. They are placed a little
  // smaller, and holes are left where patches meet.
  EXPECT_GT(lattice, 0.9 * 4 * std::numbers::pi);
  EXPECT_LT(lattice, 1.3 * 4 * std::numbers::pi);
  EXPECT_LT(static_cast<double>(grown.asked), 1.3 * static_cast<double>(grown.points.size()));
}

// A size that changes within a spacing cannot be sampled by a lattice, and few queries show that.
TEST(Growth, GivesUpWhereSizesChangeWithinASpacing) {
  const auto share = [](const Eigen::Vector3d& y) {
    return 0.6 + 0.4 * std::sin(1e4 * y[0] + 7e3 * y[1]);
  };
  EXPECT_LT(GrowGraded(0.05, share).asked, 1000);
}

TEST(Growth, TakesOneOfSeedsThatLieTogetherAndThoseItHasNotReached) {
  Growth<2> growth(3, 1);
  const Eigen::Matrix<double, 6, 1> frame{1, 0, 0, 0, 1, 0};
  Eigen::Matrix3Xd seeds(3, 4);
  seeds << 0, 3, 100, 200, 0, 0, 0, 0, 0, 0, 0, 0;
  const Eigen::MatrixXd tangents = frame.replicate(1, 4);
  EXPECT_EQ(growth.Begin(seeds, tangents, {1, 1, 1, 0}, 10), (std::vector<Eigen::Index>{0, 2}));
  EXPECT_EQ(growth.Begin(seeds, tangents, {1, 1, 1, 1}, 10), (std::vector<Eigen::Index>{1, 3}));
  EXPECT_TRUE(growth.Begin(seeds, tangents, {1, 1, 1, 1}, 10).empty());
}

TEST(Growth, LeavesAHoleWhereNothingIsFoundOrTheAnswersLieFarAway) {
  const auto sphere = Make("sphere:2");
  const auto none_above = [](Answered* a) {
    for (Eigen::Index c = 0; c < a->points.cols(); ++c)
      a->found[static_cast<std::size_t>(c)] = a->points(2, c) < 0.5;
  };
  const Eigen::MatrixXd below = Grow<2>(*sphere, 0.2, Eigen::Vector3d(0, 0, -1), 1, none_above);
  EXPECT_LT(below.row(2).maxCoeff(), 0.5);
  EXPECT_GT(below.cols(), 200);
  const auto elsewhere = [](Answered* a) { a->points.row(2).setConstant(5); };
  EXPECT_EQ(Grow<2>(*sphere, 0.2, Eigen::Vector3d(0, 0, -1), 1, elsewhere).cols(), 1);
  const auto one_place = [](Answered* a) { a->points.colwise() = Eigen::Vector3d(0.1, 0, -1); };
  EXPECT_LE(Grow<2>(*sphere, 0.2, Eigen::Vector3d(0, 0, -1), 1, one_place).cols(), 2);
}

TEST(Growth, DoesNotCarryALatticeOverACorner) {
  const auto sphere = Make("sphere:2");
  const auto turned = [](Answered* a) {
    for (Eigen::Index c = 0; c < a->tangents.cols(); ++c) {
      const Eigen::Vector3d n = a->points.col(c).normalized();
      a->tangents.col(c).head(3) = n;  // a tangent space that holds the normal
      a->tangents.col(c).tail(3) = n.unitOrthogonal();
    }
  };
  EXPECT_LE(Grow<2>(*sphere, 0.1, Eigen::Vector3d(0, 0, -1), 1, turned).cols(), 3);
}

TEST(Growth, IsTheSameForAnyNumberOfThreads) {
  const auto torus = Make("torus");
  Eigen::MatrixXd seeds = Eigen::MatrixXd::Zero(3, 8);
  for (Eigen::Index c = 0; c < 8; ++c)
    seeds.col(c) = Eigen::Vector3d(std::cos(0.8 * static_cast<double>(c)),
                                   std::sin(0.8 * static_cast<double>(c)), 0.3);
  const auto grow = [&](int threads) {
    Eigen::MatrixXd sample;
    tbb::task_arena(threads).execute([&] { sample = Grow<2>(*torus, 0.06, seeds, 0.3); });
    return sample;
  };
  const Eigen::MatrixXd one = grow(1);
  EXPECT_GT(one.cols(), 1500);
  EXPECT_EQ(grow(2), one);
  EXPECT_EQ(grow(4), one);
}

}  // namespace
}  // namespace stellate::core
