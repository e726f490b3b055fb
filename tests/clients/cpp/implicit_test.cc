#include "stellate/implicit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "stellate/catalogue.h"
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
