#include "core/geometry/common_centre.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stellate::core {
namespace {

constexpr double kAnySize = std::numeric_limits<double>::infinity();

// A simplex with vertices on the unit sphere S^K in R^(K+1), about one point of it.
template <int K>
struct OnSphere {
  using Vector = Eigen::Matrix<double, K + 1, 1>;
  // Rows: an orthonormal basis of the tangent space.
  using Tangent = Eigen::Matrix<double, K, K + 1, Eigen::RowMajor>;

  std::array<Vector, K + 1> points;
  std::array<Tangent, K + 1> tangents;

  // `size`: about the circumradius.
  OnSphere(double size, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Vector middle;
    for (int i = 0; i <= K; ++i) middle[i] = normal(random);
    middle.normalize();
    const Tangent around = TangentAt(middle);
    for (int i = 0; i <= K; ++i) {
      // The corners of a regular simplex, shaken.
      Vector corner = Vector::Constant(-1.0 / (K + 1));
      corner[i] += 1;
      for (int j = 0; j <= K; ++j) corner[j] += 0.1 * normal(random);
      corner.array() -= corner.mean();
      const Eigen::Matrix<double, K, 1> flat = PlaneBasis() * corner.normalized();
      points[i] = (middle + size * around.transpose() * flat).normalized();
      tangents[i] = TangentAt(points[i]);
    }
  }

  // Orthonormal rows across (1, ..., 1).
  static Tangent PlaneBasis() { return TangentAt(Vector::Ones().normalized()); }
  static Tangent TangentAt(const Vector& p) {
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(p).householderQ() *
                              Eigen::MatrixXd::Identity(K + 1, K + 1);
    return q.rightCols(K).transpose();
  }

  // In the order given; the centre in R^(K+1).
  bool Centre(const std::array<int, K + 1>& order, double most2, Vector* centre) const {
    std::array<const double*, K + 1> p, t;
    for (int i = 0; i <= K; ++i) {
      p[i] = points[order[i]].data();
      t[i] = tangents[order[i]].data();
    }
    const std::array<double, K + 1> weights{};
    if (!CommonCentre<K>(K + 1, p.data(), t.data(), weights.data(), most2, centre->data()))
      return false;
    *centre += points[order[0]];
    return true;
  }
  static std::array<int, K + 1> AsGiven() {
    std::array<int, K + 1> order;
    for (int i = 0; i <= K; ++i) order[i] = i;
    return order;
  }
};

template <typename Simplex>
class CommonCentreTest : public ::testing::Test {};
using Simplices = ::testing::Types<OnSphere<2>, OnSphere<3>, OnSphere<4>>;
TYPED_TEST_SUITE(CommonCentreTest, Simplices);

TYPED_TEST(CommonCentreTest, IsEquidistantFromTheVertices) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    const TypeParam simplex(0.5, seed);
    typename TypeParam::Vector centre;
    ASSERT_TRUE(simplex.Centre(TypeParam::AsGiven(), kAnySize, &centre));
    const double radius = (centre - simplex.points[0]).norm();
    for (const auto& p : simplex.points) EXPECT_NEAR((centre - p).norm(), radius, 1e-12);
  }
}

TYPED_TEST(CommonCentreTest, DependsOnTheSimplexAlone) {
  const TypeParam simplex(0.4, 7);
  auto order = TypeParam::AsGiven();
  typename TypeParam::Vector centre, other;
  ASSERT_TRUE(simplex.Centre(order, kAnySize, &centre));
  while (std::next_permutation(order.begin(), order.end())) {
    ASSERT_TRUE(simplex.Centre(order, kAnySize, &other));
    EXPECT_NEAR((centre - other).norm(), 0, 1e-6);
  }
}

TYPED_TEST(CommonCentreTest, IsNoneForSimplicesBeyondTheSizeAskedFor) {
  const TypeParam simplex(0.4, 3);
  typename TypeParam::Vector centre;
  EXPECT_TRUE(simplex.Centre(TypeParam::AsGiven(), 0.5 * 0.5, &centre));
  EXPECT_FALSE(simplex.Centre(TypeParam::AsGiven(), 0.3 * 0.3, &centre));
  EXPECT_FALSE(simplex.Centre(TypeParam::AsGiven(), 0.01 * 0.01, &centre));
}

TYPED_TEST(CommonCentreTest, IsNoneForAFlatSimplex) {
  TypeParam simplex(0.4, 3);
  simplex.points[1] = simplex.points[0];
  simplex.tangents[1] = simplex.tangents[0];
  typename TypeParam::Vector centre;
  EXPECT_FALSE(simplex.Centre(TypeParam::AsGiven(), kAnySize, &centre));
}

// How far off the sphere, at most, over some simplices.
template <int K>
double Off(double size) {
  double most = 0;
  for (unsigned seed = 0; seed < 50; ++seed) {
    const OnSphere<K> simplex(size, seed);
    typename OnSphere<K>::Vector centre;
    EXPECT_TRUE(simplex.Centre(OnSphere<K>::AsGiven(), kAnySize, &centre));
    most = std::max(most, std::abs(centre.norm() - 1));
  }
  return most;
}

TEST(CommonCentre, LiesNearMBesideSmallSimplices) {
  EXPECT_LT(Off<2>(0.1), 1e-4);
  EXPECT_LT(Off<3>(0.1), 1e-4);
  EXPECT_LT(Off<4>(0.1), 1e-4);
  // Half the size, an eighth of the distance or less.
  EXPECT_LT(Off<2>(0.1) * 8, Off<2>(0.2));
  EXPECT_LT(Off<3>(0.1) * 8, Off<3>(0.2));
}

// The lift by halves alone leaves simplices of 0.6 reach some 2 % of the reach off M.
TEST(CommonCentre, LiesNearMBesideLargeSimplicesFromKThreeOn) {
  EXPECT_GT(Off<2>(0.6), 1e-2);
  EXPECT_LT(Off<3>(0.6), 2e-3);
  EXPECT_LT(Off<4>(0.6), 2e-3);
}

}  // namespace
}  // namespace stellate::core
