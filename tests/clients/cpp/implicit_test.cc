#include "stellate/implicit.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "stellate/catalogue.h"
#include "stellate/oracles/walls.h"
#include "support/oracle_invariants.h"

namespace stellate {
namespace {

using testing::InvariantOptions;
using testing::OracleInvariantsHold;

BoundingBox Cube(int d, double half) {
  return {Eigen::VectorXd::Constant(d, -half), Eigen::VectorXd::Constant(d, half)};
}

// Torus of radii 1 and 0.4 as a level set.
Eigen::VectorXd TorusValue(const Eigen::VectorXd& x) {
  const double a = x.squaredNorm() + 1 - 0.16;
  return Eigen::VectorXd::Constant(1, a * a - 4 * (x[0] * x[0] + x[1] * x[1]));
}
Eigen::MatrixXd TorusJacobian(const Eigen::VectorXd& x) {
  Eigen::MatrixXd j = 4 * (x.squaredNorm() + 1 - 0.16) * x.transpose();
  j.leftCols(2) -= 8 * x.head(2).transpose();
  return j;
}

// Viviani-like curve of R^3, codimension 2: the unit sphere cut by the cylinder x^2 + 2 y^2 = 0.6.
Eigen::VectorXd CurveValue(const Eigen::VectorXd& x) {
  Eigen::VectorXd f(2);
  f << x.squaredNorm() - 1, x[0] * x[0] + 2 * x[1] * x[1] - 0.6;
  return f;
}

TEST(ImplicitOracle, AgreesWithTheClosedForm) {
  ImplicitOracle implicit(2, 3, TorusValue, TorusJacobian, Cube(3, 1.6));
  const auto torus = MakeManifold("torus:1:0.4").value();
  // Within half the reach of the torus the closest point is unique.
  const Eigen::MatrixXd on = torus->ClosestPoint(Eigen::MatrixXd::Random(3, 300)).points;
  const Eigen::MatrixXd x = on + 0.2 / std::sqrt(3) * Eigen::MatrixXd::Random(3, 300);
  const Answer expected = torus->ClosestPoint(x), got = implicit.ClosestPoint(x);
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    ASSERT_TRUE(got.IsFound(j));
    EXPECT_LT((expected.points.col(j) - got.points.col(j)).norm(), 1e-11) << x.col(j).transpose();
  }
}

// Coordinates of surveyors: a sphere of unit size a hundred million units from the origin.
TEST(ImplicitOracle, FarOriginsDoNotMatter) {
  const Eigen::VectorXd center = Eigen::VectorXd::Constant(3, 1e8);
  const auto value = [&](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, (x - center).squaredNorm() - 1);
  };
  const auto jacobian = [&](const Eigen::VectorXd& x) -> Eigen::MatrixXd {
    return 2 * (x - center).transpose();
  };
  BoundingBox box = Cube(3, 2);
  box.lower += center, box.upper += center;
  ImplicitOracle sphere(2, 3, value, jacobian, box);
  Eigen::MatrixXd away = Eigen::MatrixXd::Random(3, 300);
  away.colwise().normalize();
  const Answer got = sphere.ClosestPoint((1.3 * away).colwise() + center);
  for (Eigen::Index j = 0; j < away.cols(); ++j) {
    ASSERT_TRUE(got.IsFound(j));
    EXPECT_LT((got.points.col(j) - center - away.col(j)).norm(), 1e-6);
  }
}

// Only where the closest point is unique do local minimisers have to find it.
class SeededImplicit : public ::testing::Test {
 protected:
  static void Check(int k, int d, const ImplicitOracle::Function& f,
                    const ImplicitOracle::Jacobian& jacobian, double tolerance) {
    class Near final : public Oracle {
     public:
      explicit Near(ImplicitOracle& inner) : inner_(inner) {
        on_ = inner.ClosestPoint(Eigen::MatrixXd::Random(inner.ambient_dimension(), 40)).points;
      }
      int dimension() const override { return inner_.dimension(); }
      int ambient_dimension() const override { return inner_.ambient_dimension(); }
      Answer ClosestPoint(const Eigen::MatrixXd& x) override { return inner_.ClosestPoint(x); }
      bool has_intersect_flat() const override { return true; }
      Answer IntersectFlat(const Eigen::MatrixXd& c, const Eigen::MatrixXd& t,
                           const Eigen::VectorXd& r) override {
        return inner_.IntersectFlat(c, t, r);
      }
      bool has_tangent_basis() const override { return true; }
      Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& p) override {
        return inner_.TangentBasis(p);
      }
      Eigen::MatrixXd seeds() const override {
        return on_ + 0.02 * Eigen::MatrixXd::Ones(on_.rows(), on_.cols());
      }

     private:
      ImplicitOracle& inner_;
      Eigen::MatrixXd on_;
    };
    ImplicitOracle implicit(k, d, f, jacobian, Cube(d, 1.5));
    Near near(implicit);
    InvariantOptions options;
    options.tolerance = tolerance;
    EXPECT_TRUE(OracleInvariantsHold(near, options));
  }
};

TEST_F(SeededImplicit, SurfaceKeepsTheLaws) { Check(2, 3, TorusValue, TorusJacobian, 1e-10); }
TEST_F(SeededImplicit, SurfaceByDifferencesKeepsTheLaws) { Check(2, 3, TorusValue, {}, 1e-9); }
TEST_F(SeededImplicit, CurveOfCodimensionTwoKeepsTheLaws) { Check(1, 3, CurveValue, {}, 1e-9); }

TEST_F(SeededImplicit, SphereInFiveDimensionsKeepsTheLaws) {
  Check(
      4, 5,
      [](const Eigen::VectorXd& x) { return Eigen::VectorXd::Constant(1, x.squaredNorm() - 1); },
      [](const Eigen::VectorXd& x) { return Eigen::MatrixXd(2 * x.transpose()); }, 1e-10);
}

// Values of F cost users more than all else: a foot near the torus takes six differences in vain if
// its Jacobian is computed once more than has to be.
TEST(ImplicitOracle, AnswersNearTheManifoldTakeFewValues) {
  int calls = 0;
  const auto value = [&calls](const Eigen::VectorXd& x) {
    ++calls;
    return TorusValue(x);
  };
  ImplicitOracle torus(2, 3, value, {}, Cube(3, 1.6));
  const Eigen::MatrixXd on = torus.ClosestPoint(Eigen::MatrixXd::Random(3, 200)).points;
  const Eigen::MatrixXd x = on + 0.02 * Eigen::MatrixXd::Random(3, 200);
  const auto each = [&calls, before = 0]() mutable {
    const double count = (calls - before) / 200.0;
    before = calls;
    return count;
  };
  auto values = each;
  values();  // those of finding `on`
  const Answer feet = torus.ClosestPoint(x);
  EXPECT_LT(values(), 30);
  const Eigen::MatrixXd bases = torus.TangentBasis(on);
  EXPECT_LE(values(), 6);
  const Answer flats = torus.IntersectFlat(x, bases, Eigen::VectorXd::Constant(200, 0.2));
  EXPECT_LT(values(), 20);
  for (Eigen::Index j = 0; j < 200; ++j) {
    ASSERT_TRUE(feet.IsFound(j) && flats.IsFound(j));
    const Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>> basis(bases.col(j).data());
    EXPECT_LT((basis.transpose() * (flats.points.col(j) - x.col(j))).norm(), 1e-12);
    EXPECT_LT(TorusValue(flats.points.col(j)).norm(), 1e-11);
  }
}

// Half a sphere, z = sqrt(1 - x^2 - y^2): beyond its rim f is not a number.
TEST(ImplicitOracle, RefusesToSayHowItGoesOnWhereItsFunctionEnds) {
  const auto value = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, x[2] - std::sqrt(1 - x[0] * x[0] - x[1] * x[1]));
  };
  ImplicitOracle half(2, 3, value, {}, Cube(3, 2));
  const auto at = [](double z) { return Eigen::Vector3d(std::sqrt(1 - z * z), 0, z); };
  EXPECT_EQ(half.TangentBasis(at(0.3)).rows(), 6);
  try {
    half.TangentBasis(at(0.005));
    FAIL() << "a tangent space beside NaN";
  } catch (const OracleError& error) {
    EXPECT_EQ(error.reason(), "ORACLE_NOT_FINITE");
    EXPECT_NE(std::string(error.what()).find("ends where f does, near [0.99998"), std::string::npos)
        << error.what();
  }
}

// T^2 in R^4, its walls a bowl and a half-space: curves, and where both are zero, points.
TEST(ImplicitOracle, FacesAreSolvedWithTheEquations) {
  const auto value = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd(
        Eigen::Vector2d(x.head(2).squaredNorm() - 1, x.tail(2).squaredNorm() - 1));
  };
  const auto jacobian = [](const Eigen::VectorXd& x) {
    Eigen::MatrixXd j = Eigen::MatrixXd::Zero(2, 4);
    j.row(0).head(2) = 2 * x.head(2).transpose();
    j.row(1).tail(2) = 2 * x.tail(2).transpose();
    return j;
  };
  const auto bowl = [](const Eigen::VectorXd& x) { return x[0] + 0.3 * x[3] * x[3]; };
  const auto slope = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return Eigen::Vector4d(1, 0, 0, 0.6 * x[3]);
  };
  for (const bool given : {false, true}) {
    const auto torus = std::make_shared<ImplicitOracle>(
        2, 4, value, given ? ImplicitOracle::Jacobian(jacobian) : ImplicitOracle::Jacobian(),
        Cube(4, 1.5));
    const oracles::Wall wall = given ? oracles::Wall{bowl, slope} : oracles::Wall{bowl, {}};
    oracles::Clipped cut(torus, {wall, oracles::HalfSpace(Eigen::Vector4d(0, 0, 1, 0.2), 0)});
    const Eigen::MatrixXd on = torus->ClosestPoint(Eigen::MatrixXd::Random(4, 200)).points;
    const Eigen::MatrixXd x =
        cut.FacePoint(on, {0}).points + 0.05 * Eigen::MatrixXd::Random(4, 200);
    const Answer curve = cut.FacePoint(x, {0}), corners = cut.FacePoint(x, {0, 1});
    int met = 0;
    for (Eigen::Index j = 0; j < 200; ++j) {
      ASSERT_TRUE(curve.IsFound(j)) << x.col(j).transpose();
      const Eigen::VectorXd p = curve.points.col(j);
      EXPECT_LT(value(p).norm() + std::abs(bowl(p)), 1e-11);
      Eigen::MatrixXd across(4, 3);
      across << jacobian(p).transpose(), slope(p);
      const Eigen::VectorXd along =
          Eigen::HouseholderQR<Eigen::MatrixXd>(across).householderQ() * Eigen::Vector4d::Unit(3);
      EXPECT_LT(std::abs(along.dot(x.col(j) - p)), 1e-9);
      if (!corners.IsFound(j)) continue;
      ++met;
      const Eigen::VectorXd q = corners.points.col(j);
      EXPECT_LT(value(q).norm() + cut.Clearances(q).norm(), 1e-11);
    }
    EXPECT_GT(met, 150);
  }
}

// Their equations have no Jacobian of full rank where they come nearest to each other.
TEST(ImplicitOracle, NothingIsFoundOnWallsThatNeverMeet) {
  const auto value = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, x.squaredNorm() - 1);
  };
  const auto sphere =
      std::make_shared<ImplicitOracle>(2, 3, value, ImplicitOracle::Jacobian(), Cube(3, 1.4));
  oracles::Clipped cut(sphere,
                       oracles::Box(-0.8 * Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones()));
  for (const Walls& face : {Walls{0, 1}, Walls{0, 3}, Walls{0}, Walls{3}}) {
    const Answer answer = cut.FacePoint(1.4 * Eigen::MatrixXd::Random(3, 60), face);
    for (Eigen::Index j = 0; j < 60; ++j) {
      if (!answer.IsFound(j)) continue;
      const Eigen::VectorXd p = answer.points.col(j), clearances = cut.Clearances(p);
      EXPECT_LT(value(p).norm(), 1e-9);
      for (const int wall : face) EXPECT_LT(std::abs(clearances[wall]), 1e-9) << p.transpose();
    }
  }
}

TEST(ImplicitOracle, SaysWhenItDoesNotConverge) {
  // x^2 + y^2 + 1 has no zero.
  ImplicitOracle nowhere(
      1, 2,
      [](const Eigen::VectorXd& x) { return Eigen::VectorXd::Constant(1, x.squaredNorm() + 1); },
      {}, Cube(2, 1));
  const Answer answer = nowhere.ClosestPoint(Eigen::MatrixXd::Random(2, 10));
  for (Eigen::Index j = 0; j < 10; ++j) EXPECT_FALSE(answer.IsFound(j));
}

TEST(ImplicitOracle, RefusesSizesThatMakeNoSense) {
  EXPECT_THROW(ImplicitOracle(3, 3, TorusValue, {}, Cube(3, 1)), std::invalid_argument);
  EXPECT_THROW(ImplicitOracle(0, 3, TorusValue, {}, Cube(3, 1)), std::invalid_argument);
  EXPECT_THROW(ImplicitOracle(2, 3, TorusValue, {}, Cube(2, 1)), std::invalid_argument);
}

}  // namespace
}  // namespace stellate
