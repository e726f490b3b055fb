#include "stellate/catalogue.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "support/make_manifold.h"
#include "support/oracle_invariants.h"

namespace stellate {
namespace {

using testing::Make;

using testing::InvariantOptions;
using testing::OracleInvariantsHold;

class EveryManifold : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryManifold, KeepsTheLawsOfAnOracle) {
  const std::unique_ptr<Manifold> manifold = Make(GetParam());
  ASSERT_NE(manifold, nullptr);
  for (const std::uint64_t seed : {1, 2, 3}) {
    InvariantOptions options;
    options.random_seed = seed;
    options.clearance = 0.5 * manifold->facts().reach.value_or(0.3);
    options.tolerance = 1e-12;
    EXPECT_TRUE(OracleInvariantsHold(*manifold, options));
  }
}

TEST_P(EveryManifold, HasFactsThatAgree) {
  const std::unique_ptr<Manifold> manifold = Make(GetParam());
  ASSERT_NE(manifold, nullptr);
  const ManifoldFacts& facts = manifold->facts();
  const size_t k = static_cast<size_t>(facts.dimension);
  ASSERT_EQ(facts.betti_mod2.size(), k + 1);
  ASSERT_EQ(facts.betti_mod3.size(), k + 1);
  int euler2 = 0, euler3 = 0;
  for (size_t i = 0; i <= k; ++i) {
    // Poincare duality holds over Z/2 for every closed manifold, over Z/3 for orientable ones.
    EXPECT_EQ(facts.betti_mod2[i], facts.betti_mod2[k - i]);
    if (facts.orientable) {
      EXPECT_EQ(facts.betti_mod3[i], facts.betti_mod3[k - i]);
    }
    euler2 += (i % 2 == 0 ? 1 : -1) * facts.betti_mod2[i];
    euler3 += (i % 2 == 0 ? 1 : -1) * facts.betti_mod3[i];
  }
  EXPECT_EQ(euler2, facts.euler_characteristic);
  EXPECT_EQ(euler3, facts.euler_characteristic);
  EXPECT_EQ(facts.betti_mod3[k] == facts.betti_mod3[0], facts.orientable);
}

std::vector<std::string> Specs() {
  std::vector<std::string> specs = {"circle",         "sphere:3",
                                    "sphere:4:7",     "ellipsoid:2:1",
                                    "ellipsoid",      "rp2",
                                    "torus",          "ellipsoid:1:0.9:0.8:0.7",
                                    "so3@12",         "torus-knot:3:5",
                                    "tanglecube@6",   "ellipsoid:1:1:0.5",
                                    "sphere:2:100",   "clifford-torus@9",
                                    "two-spheres@5",  "ellipsoid:1:0.7:0.7:0.7",
                                    "torus:1:0.4@100"};
  for (const CatalogueEntry& entry : ListManifolds()) specs.push_back(entry.example);
  return specs;
}

std::string NameOf(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param;
  name += '_';
  name += std::to_string(info.index);
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryManifold, ::testing::ValuesIn(Specs()), NameOf);

// Distances that geometry gives by hand.
TEST(ManifoldDistance, IsExactWhereItIsKnown) {
  const auto distance = [](const std::string& spec, const Eigen::VectorXd& x) {
    return Make(spec)->Distance(x)[0];
  };
  EXPECT_NEAR(distance("sphere:2", Eigen::Vector3d(0, 0, 3)), 2, 1e-15);
  EXPECT_NEAR(distance("sphere:2", Eigen::Vector3d::Zero()), 1, 1e-15);
  EXPECT_NEAR(distance("torus:2:0.5", Eigen::Vector3d(0, 0, 1)), std::sqrt(5) - 0.5, 1e-15);
  EXPECT_NEAR(distance("two-spheres", Eigen::Vector3d::Zero()), 0.5, 1e-15);
  EXPECT_NEAR(distance("torus-knot:2:3", Eigen::Vector3d(3.25, 0, 0)), 0.25, 1e-15);
  // The centre of an ellipsoid, and a point on its longest axis inside the focal curve.
  EXPECT_NEAR(distance("ellipsoid:3:2:1", Eigen::Vector3d::Zero()), 1, 1e-15);
  EXPECT_NEAR(distance("ellipsoid:2:1", Eigen::Vector2d(0.3, 0)), std::sqrt(1 - 0.09 / 3), 1e-14);
  // Twice a rotation, and the zero matrix, which all rotations are equally far from.
  Eigen::VectorXd twice = Eigen::VectorXd::Zero(9);
  twice[0] = twice[4] = twice[8] = 2;
  EXPECT_NEAR(distance("so3", twice), std::sqrt(3), 1e-14);
  EXPECT_NEAR(distance("so3", Eigen::VectorXd::Zero(9)), std::sqrt(3), 1e-14);
  // A reflection's nearest rotations undo it in one direction: it is a whole 2 away.
  Eigen::VectorXd mirror = Eigen::VectorXd::Zero(9);
  mirror[0] = mirror[4] = 1;
  mirror[8] = -1;
  EXPECT_NEAR(distance("so3", mirror), 2, 1e-14);
}

TEST(ManifoldDistance, IsGlobalForTheTanglecubeAndTheKnot) {
  // Against the nearest of many points of the manifold, from all over its box.
  for (const std::string spec : {"tanglecube", "torus-knot:2:3", "torus-knot:3:7"}) {
    const std::unique_ptr<Manifold> manifold = Make(spec);
    const BoundingBox box = *manifold->bounding_box();
    std::srand(7);
    const auto random_points = [&](Eigen::Index n) {
      const Eigen::MatrixXd unit = (Eigen::MatrixXd::Random(3, n).array() + 1) / 2;
      return Eigen::MatrixXd(((box.upper - box.lower).asDiagonal() * unit).colwise() + box.lower);
    };
    const Eigen::MatrixXd points = manifold->ClosestPoint(random_points(4000)).points;
    const Eigen::MatrixXd queries = random_points(400);
    const Eigen::VectorXd distance = manifold->Distance(queries);
    for (Eigen::Index j = 0; j < queries.cols(); ++j) {
      const double seen =
          std::sqrt((points.colwise() - queries.col(j)).colwise().squaredNorm().minCoeff());
      EXPECT_LE(distance[j], seen + 1e-12) << spec << " at " << queries.col(j).transpose();
    }
  }
}

// Points of the turned ellipsoid span three dimensions, and in coordinates of that span they
// satisfy z^T A z = 1 with A of the original's eigenvalues 1 / a_i^2: only an isometry does that.
TEST(TurnedManifold, IsIsometricToTheOriginal) {
  const std::unique_ptr<Manifold> turned = Make("ellipsoid:1:0.8:0.5@30");
  std::srand(3);
  const Eigen::MatrixXd points = turned->ClosestPoint(Eigen::MatrixXd::Random(30, 100)).points;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(points, Eigen::ComputeThinU);
  EXPECT_LT(svd.singularValues()[3], 1e-12);
  const Eigen::MatrixXd z = svd.matrixU().leftCols(3).transpose() * points;
  Eigen::MatrixXd monomials(100, 6);
  monomials << z.cwiseProduct(z).transpose(), z.row(0).cwiseProduct(z.row(1)).transpose(),
      z.row(0).cwiseProduct(z.row(2)).transpose(), z.row(1).cwiseProduct(z.row(2)).transpose();
  const Eigen::VectorXd a = monomials.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(100));
  Eigen::Matrix3d form;
  form << a[0], a[3] / 2, a[4] / 2, a[3] / 2, a[1], a[5] / 2, a[4] / 2, a[5] / 2, a[2];
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(form).eigenvalues();
  EXPECT_NEAR(eigenvalues[0], 1, 1e-10);
  EXPECT_NEAR(eigenvalues[1], 1 / 0.64, 1e-10);
  EXPECT_NEAR(eigenvalues[2], 4, 1e-10);
}

// Rounds are cut into chunks as workers come and go, and the mesh must not show it.
TEST(TurnedManifold, AnswersAloneAsInABatch) {
  const auto manifold = MakeManifold("torus@20").value();
  constexpr Eigen::Index kCount = 37;
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(20, kCount);
  const Eigen::MatrixXd points = manifold->ClosestPoint(x).points;
  const Eigen::MatrixXd tangents = manifold->TangentBasis(points);
  const Eigen::VectorXd radii = Eigen::VectorXd::Constant(kCount, 1.0);
  const Answer met = manifold->IntersectFlat(points, tangents, radii);
  for (Eigen::Index first = 0; first < kCount; first += 5) {
    const Eigen::Index count = std::min<Eigen::Index>(5, kCount - first);
    const Eigen::MatrixXd part = points.middleCols(first, count);
    const Eigen::MatrixXd bases = tangents.middleCols(first, count);
    EXPECT_EQ(manifold->ClosestPoint(x.middleCols(first, count)).points, part);
    EXPECT_EQ(manifold->TangentBasis(part), bases);
    const Answer again = manifold->IntersectFlat(part, bases, radii.segment(first, count));
    EXPECT_EQ(again.points, met.points.middleCols(first, count));
  }
}

// The medial axis is where the largest balls are centred that touch M and hold none of it: those
// that touch at sample points, along random normals, are found by bisection.
TEST(LocalSize, IsTheDistanceToTheMedialAxis) {
  for (const std::string spec : {"sphere:2:5", "two-spheres", "torus:1:0.4", "torus:1:0.9@4",
                                 "circles:1:0.5", "ellipsoid:3:2:1", "ellipsoid:1:1:10",
                                 "ellipsoid:1:5", "ellipsoid:1:1:1", "so3", "rp2:5"}) {
    const std::unique_ptr<Manifold> manifold = Make(spec);
    ASSERT_TRUE(manifold->has_local_size()) << spec;
    const int d = manifold->ambient_dimension(), k = manifold->dimension();
    const BoundingBox box = *manifold->bounding_box();
    std::srand(5);
    const Eigen::Index count = 600;
    const Eigen::MatrixXd unit = (Eigen::MatrixXd::Random(d, count).array() + 1) / 2;
    const Eigen::MatrixXd points =
        manifold->ClosestPoint(((box.upper - box.lower).asDiagonal() * unit).colwise() + box.lower)
            .points;
    const Eigen::MatrixXd bases = manifold->TangentBasis(points);
    Eigen::MatrixXd normals = Eigen::MatrixXd::Random(d, count);
    for (Eigen::Index j = 0; j < count; ++j) {
      for (int pass = 0; pass < 2; ++pass) {
        for (int a = 0; a < k; ++a) {
          Eigen::VectorXd t(d);
          for (int i = 0; i < d; ++i) t[i] = bases(i * k + a, j);
          normals.col(j) -= t * t.dot(normals.col(j));
        }
        normals.col(j).normalize();
      }
    }
    const double most = 4 * (box.upper - box.lower).norm();
    Eigen::VectorXd low = Eigen::VectorXd::Zero(count),
                    high = Eigen::VectorXd::Constant(count, most);
    for (int step = 0; step < 40; ++step) {
      const Eigen::VectorXd radius = (low + high) / 2;
      const Eigen::VectorXd empty =
          manifold->Distance(points + normals * radius.asDiagonal()) - radius;
      for (Eigen::Index j = 0; j < count; ++j)
        (empty[j] > -1e-9 * radius[j] ? low : high)[j] = radius[j];
    }
    const Eigen::VectorXd sizes = manifold->LocalSize(points);
    const double reach = *manifold->facts().reach;
    EXPECT_GE(sizes.minCoeff(), reach * (1 - 1e-9)) << spec;
    double largest_gap = 0;
    for (Eigen::Index j = 0; j < count; ++j) {
      double nearest = most;
      for (Eigen::Index c = 0; c < count; ++c) {
        if (high[c] == most) continue;  // the medial axis is not that way
        const Eigen::VectorXd centre = points.col(c) + low[c] * normals.col(c);
        nearest = std::min(nearest, (centre - points.col(j)).norm());
      }
      EXPECT_GE(nearest, sizes[j] * (1 - 1e-3)) << spec << " at " << points.col(j).transpose();
      largest_gap = std::max(largest_gap, nearest / sizes[j]);
    }
    EXPECT_LT(largest_gap, 2) << spec;
    // It is 1-Lipschitz, and a column's does not depend on the others.
    EXPECT_EQ(manifold->LocalSize(points.col(7))[0], sizes[7]) << spec;
    for (Eigen::Index j = 1; j < count; ++j) {
      EXPECT_LE(std::abs(sizes[j] - sizes[j - 1]),
                (points.col(j) - points.col(j - 1)).norm() + 1e-9)
          << spec;
    }
  }
  EXPECT_FALSE(Make("tanglecube")->has_local_size());
}

TEST(MakeManifold, RefusesWithAReason) {
  for (const std::string spec : {"",
                                 "klein",
                                 "sphere:0",
                                 "sphere:2:2",
                                 "sphere:2.5",
                                 "torus:1:2",
                                 "torus:1:x",
                                 "torus:1:",
                                 "torus-knot:2:4",
                                 "ellipsoid:1",
                                 "ellipsoid:1:-1",
                                 "ellipsoid:1:nan",
                                 "so3:2",
                                 "so3@8",
                                 "so3@",
                                 "rp2:4",
                                 "circles",
                                 "circle:100000",
                                 "torus:1:0.4:3",
                                 "sphere:2:10@5"}) {
    const auto manifold = MakeManifold(spec);
    ASSERT_FALSE(manifold.has_value()) << spec;
    EXPECT_NE(manifold.error().message.find("'" + spec + "'"), std::string::npos)
        << manifold.error().message;
  }
}

}  // namespace
}  // namespace stellate
