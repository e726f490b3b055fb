#include "core/geometry/simplex.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/infinity.h"
#include "core/base/random.h"
#include "core/geometry/simplex_frame.h"

namespace stellate::core {
namespace {

// Vertices as columns.
struct Simplex {
  explicit Simplex(Eigen::MatrixXd v) : columns(std::move(v)) {
    for (Eigen::Index j = 0; j < columns.cols(); ++j) pointers.push_back(columns.col(j).data());
  }
  Simplex(const Simplex& other) : Simplex(other.columns) {}

  operator SimplexVertices() const { return pointers; }
  int d() const { return static_cast<int>(columns.rows()); }
  SimplexMeasures Measures() const { return MeasureSimplex(*this, d()); }

  Eigen::MatrixXd columns;
  std::vector<const double*> pointers;
};

// The regular j-simplex of edge sqrt(2): unit vectors of R^(j+1).
Simplex Regular(int j) { return Simplex(Eigen::MatrixXd::Identity(j + 1, j + 1)); }

Simplex RandomSimplex(int j, int d, std::uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd v(d, j + 1);
  for (Eigen::Index i = 0; i < v.size(); ++i) v(i) = random.NearlyNormal();
  return Simplex(v);
}

Eigen::MatrixXd RandomOrthonormal(int d, int k, std::uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd m(d, k);
  for (Eigen::Index i = 0; i < m.size(); ++i) m(i) = random.NearlyNormal();
  return Eigen::HouseholderQR<Eigen::MatrixXd>(m).householderQ() * Eigen::MatrixXd::Identity(d, k);
}

// Four points of a square, one lifted by h: the classical sliver.
Simplex SquareSliver(double h) {
  Eigen::MatrixXd v(3, 4);
  v << 1, 0, -1, 0,  //
      0, 1, 0, -1,   //
      0, h, 0, h;
  return Simplex(v);
}

TEST(MeasureSimplex, RegularSimplicesHaveTheirClosedForms) {
  double factorial = 1;
  for (int j = 1; j <= kMaxSimplexDimension; ++j) {
    factorial *= j;
    const SimplexMeasures m = Regular(j).Measures();
    const double edge = std::sqrt(2.0);
    const double volume = std::sqrt(j + 1.0) / factorial;
    EXPECT_NEAR(m.volume, volume, 1e-14) << j;
    EXPECT_NEAR(m.diameter, edge, 1e-14) << j;
    EXPECT_NEAR(m.shortest_edge, edge, 1e-14) << j;
    EXPECT_NEAR(m.circumradius, std::sqrt(j / (j + 1.0)), 1e-14) << j;
    EXPECT_NEAR(m.RadiusEdgeRatio(), std::sqrt(j / (2.0 * (j + 1))), 1e-14) << j;
    EXPECT_NEAR(m.Fatness(), volume / std::pow(edge, j), 1e-14) << j;
  }
}

TEST(MeasureSimplex, AVertexHasVolumeOne) {
  const SimplexMeasures m = RandomSimplex(0, 4, 1).Measures();
  EXPECT_EQ(m.volume, 1);
  EXPECT_EQ(m.Fatness(), 1);
  EXPECT_EQ(m.RadiusEdgeRatio(), 0);
}

TEST(MeasureSimplex, ARightTriangleHasItsHypotenuseAsDiameterOfItsCircle) {
  Eigen::MatrixXd v(2, 3);
  v << 0, 3, 0,  //
      0, 0, 4;
  const SimplexMeasures m = Simplex(v).Measures();
  EXPECT_NEAR(m.volume, 6, 1e-14);
  EXPECT_NEAR(m.diameter, 5, 1e-14);
  EXPECT_NEAR(m.shortest_edge, 3, 1e-14);
  EXPECT_NEAR(m.circumradius, 2.5, 1e-14);
  EXPECT_NEAR(m.RadiusEdgeRatio(), 2.5 / 3, 1e-14);
  EXPECT_NEAR(m.Fatness(), 6.0 / 25, 1e-14);
}

TEST(MeasureSimplex, IsometriesDoNotMatterAndScalesDoAsUnitsSay) {
  for (int j = 1; j <= kMaxSimplexDimension; ++j) {
    for (const int d : {7, 40}) {
      const Simplex simplex = RandomSimplex(j, 7, 10 + j);
      const SimplexMeasures m = simplex.Measures();
      const Eigen::MatrixXd frame = RandomOrthonormal(d, 7, 20 + j);
      for (const double scale : {1e-6, 1.0, 1e6}) {
        const Eigen::VectorXd shift = scale * Eigen::VectorXd::LinSpaced(d, -3, 5);
        const SimplexMeasures n =
            Simplex(((scale * frame * simplex.columns).colwise() + shift).rowwise().reverse())
                .Measures();
        EXPECT_NEAR(n.volume / std::pow(scale, j), m.volume, 1e-11 * m.volume);
        EXPECT_NEAR(n.circumradius / scale, m.circumradius, 1e-11 * m.circumradius);
        EXPECT_NEAR(n.diameter / scale, m.diameter, 1e-12 * m.diameter);
        EXPECT_NEAR(n.Fatness(), m.Fatness(), 1e-11);
        EXPECT_NEAR(n.RadiusEdgeRatio(), m.RadiusEdgeRatio(), 1e-11 * m.RadiusEdgeRatio());
      }
    }
  }
}

TEST(MeasureSimplex, ThinSimplicesKeepTheirVolume) {
  for (const double h : {1e-3, 1e-6, 1e-9}) {
    // A square of diagonal 2 with two opposite corners lifted: volume 2 h / 3.
    EXPECT_NEAR(SquareSliver(h).Measures().volume, 2 * h / 3, 1e-6 * h) << h;
  }
}

TEST(MeasureSimplex, DegenerateSimplicesAreWellDefined) {
  Eigen::MatrixXd collinear(3, 3);
  collinear << 0, 1, 3,  //
      0, 1, 3,           //
      0, 1, 3;
  for (const Simplex& simplex :
       {Simplex(collinear), SquareSliver(0), Simplex(Eigen::MatrixXd::Ones(3, 3)),
        Simplex(Eigen::MatrixXd::Zero(2, 2))}) {
    const SimplexMeasures m = simplex.Measures();
    EXPECT_EQ(m.volume, 0);
    EXPECT_EQ(m.Fatness(), 0);
    EXPECT_EQ(m.circumradius, kInfinity);
    EXPECT_EQ(m.RadiusEdgeRatio(), kInfinity);
  }
}

TEST(IsSliver, NeedsFatFaces) {
  const double theta0 = 0.3;
  const Simplex sliver = SquareSliver(0.01);
  EXPECT_FALSE(IsFat(sliver, 3, theta0));
  EXPECT_TRUE(IsSliver(sliver, 3, theta0));
  EXPECT_TRUE(ContainsSliver(sliver, 3, theta0));

  // A flat triangle under a far apex: thin, but because of the triangle.
  Eigen::MatrixXd v(3, 4);
  v << 0, 1, 2, 1,     //
      0, 0.001, 0, 0,  //
      0, 0, 0, 2;
  const Simplex cap(v);
  EXPECT_FALSE(IsFat(cap, 3, theta0));
  EXPECT_FALSE(IsSliver(cap, 3, theta0));
  EXPECT_TRUE(ContainsSliver(cap, 3, theta0));

  for (int j = 2; j <= kMaxSimplexDimension; ++j) {
    EXPECT_TRUE(IsFat(Regular(j), j + 1, 0.2)) << j;
    EXPECT_FALSE(ContainsSliver(Regular(j), j + 1, 0.2)) << j;
  }
}

TEST(IsSliver, EdgesAndVerticesNeverAre) {
  EXPECT_FALSE(IsSliver(RandomSimplex(0, 3, 1), 3, 0.3));
  EXPECT_FALSE(IsSliver(RandomSimplex(1, 3, 1), 3, 0.3));
  EXPECT_FALSE(ContainsSliver(RandomSimplex(1, 3, 1), 3, 0.3));
}

TEST(IsSliver, ASimplexThatIsNotFatContainsOneAndOneWithFatFacesIsNone) {
  int seen = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const int j = 2 + static_cast<int>(seed % 3);
    const Simplex simplex = RandomSimplex(j, 5, seed);
    const double theta0 = 0.4;
    if (!IsFat(simplex, 5, theta0)) {
      EXPECT_TRUE(ContainsSliver(simplex, 5, theta0)) << seed;
      ++seen;
    } else {
      EXPECT_FALSE(IsSliver(simplex, 5, theta0)) << seed;
    }
  }
  EXPECT_GT(seen, 50);
}

TEST(AngleToTangent, IsTheTiltOfATiltedSimplex) {
  for (int j = 1; j <= 5; ++j) {
    const int d = 2 * j + 1;
    for (const double angle : {0.0, 1e-9, 0.3, 1.2}) {
      // The simplex spans e_1..e_j; the tangent turns e_1 by `angle` towards e_d, e_2 by half.
      Eigen::MatrixXd tangent = Eigen::MatrixXd::Identity(d, j);
      tangent(0, 0) = std::cos(angle);
      tangent(d - 1, 0) = std::sin(angle);
      if (j > 1) {
        tangent(1, 1) = std::cos(angle / 2);
        tangent(d - 2, 1) = std::sin(angle / 2);
      }
      Eigen::MatrixXd v = Eigen::MatrixXd::Zero(d, j + 1);
      v.topRows(j) = RandomSimplex(j, j, 5 * j).columns;
      const Simplex simplex(v);
      EXPECT_NEAR(AngleToTangent(simplex, d, tangent.data(), j), angle, 1e-12) << j;
      const double expected =
          std::pow(std::sin(angle), 2) + (j > 1 ? std::pow(std::sin(angle / 2), 2) : 0);
      EXPECT_NEAR(MeasureTilt(FrameSimplex(simplex, d), j, d, tangent.data(), j).trace(), expected,
                  1e-12);
    }
  }
}

TEST(AngleToTangent, IsARightAngleForDegenerateSimplices) {
  const std::vector<double> plane{1, 0, 0, 0, 1, 0};
  Eigen::MatrixXd v(3, 3);
  v << 0, 1, 2,  //
      0, 0, 0,   //
      0, 0, 0;
  EXPECT_EQ(AngleToTangent(Simplex(v), 3, plane.data(), 2), std::numbers::pi / 2);
}

TEST(SmallestTriangleAngle, KnownTriangles) {
  EXPECT_NEAR(SmallestTriangleAngle(Regular(2), 3), std::numbers::pi / 3, 1e-14);
  Eigen::MatrixXd v(2, 3);
  v << 0, 1, 1,  //
      0, 0, 1e-9;
  EXPECT_NEAR(SmallestTriangleAngle(Simplex(v), 2), 1e-9, 1e-20);
  EXPECT_EQ(SmallestTriangleAngle(Simplex(Eigen::MatrixXd::Ones(2, 3)), 2), 0);
}

TEST(SmallestTriangleAngle, IsTheSmallestOfThreeWhicheverVertexComesFirst) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Simplex simplex = RandomSimplex(2, 4, seed);
    double smallest = kInfinity;
    for (int a = 0; a < 3; ++a) {
      const Eigen::VectorXd u = simplex.columns.col((a + 1) % 3) - simplex.columns.col(a);
      const Eigen::VectorXd v = simplex.columns.col((a + 2) % 3) - simplex.columns.col(a);
      smallest = std::min(smallest, std::acos(u.dot(v) / u.norm() / v.norm()));
    }
    EXPECT_NEAR(SmallestTriangleAngle(simplex, 4), smallest, 1e-12);
    const SimplexMeasures m = simplex.Measures();
    EXPECT_NEAR(std::sin(smallest), m.shortest_edge / (2 * m.circumradius), 1e-12);
  }
}

TEST(SumOfSquaredSines, IsTheTraceOfTheTilt) {
  for (int j = 1; j <= 5; ++j) {
    for (const int d : {j + 1, j + 4}) {
      const Eigen::MatrixXd tangent = RandomOrthonormal(d, j, d);
      const SimplexFrame frame = FrameSimplex(RandomSimplex(j, d, j), d);
      EXPECT_NEAR(SumOfSquaredSines(frame, j, d, tangent.data(), j),
                  MeasureTilt(frame, j, d, tangent.data(), j).trace(), 1e-14);
    }
  }
}

}  // namespace
}  // namespace stellate::core
