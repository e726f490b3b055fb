// Manifolds with boundary by two oracles of nearest points, from C++ through the real server.
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>
#include <string>
#include <utility>

#include "faces.h"
#include "live.h"
#include "stellate/doctor.h"
#include "stellate/oracles/walls.h"

namespace stellate::testing {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;
using oracles::ManifoldWithBoundary;

// Nearest points, one at a time, and nothing else.
class Points final : public Oracle {
 public:
  using Project = std::function<VectorXd(const VectorXd& x)>;
  Points(int dimension, int ambient_dimension, Project project)
      : dimension_(dimension),
        ambient_dimension_(ambient_dimension),
        project_(std::move(project)) {}
  int dimension() const override { return dimension_; }
  int ambient_dimension() const override { return ambient_dimension_; }
  Answer ClosestPoint(const MatrixXd& x) override {
    MatrixXd points(x.rows(), x.cols());
    for (Eigen::Index j = 0; j < x.cols(); ++j) points.col(j) = project_(x.col(j));
    return {points, {}, {}, {}};
  }
  std::optional<BoundingBox> bounding_box() const override {
    const VectorXd corner = VectorXd::Constant(ambient_dimension_, 1.2);
    return BoundingBox{-corner, corner};
  }

 private:
  int dimension_, ambient_dimension_;
  Project project_;
};

constexpr double kTall = 0.2;  // where the cap ends

VectorXd OntoRim(const VectorXd& x) {
  return Eigen::Vector3d(0, 0, kTall) +
         std::sqrt(1 - kTall * kTall) * Eigen::Vector3d(x[0], x[1], 0).normalized();
}

VectorXd OntoCap(const VectorXd& x) {
  return x[2] < kTall * x.norm() ? OntoRim(x) : VectorXd(x.normalized());
}

std::shared_ptr<Oracle> Cap() { return std::make_shared<Points>(2, 3, OntoCap); }
std::shared_ptr<Oracle> RimOfCap() { return std::make_shared<Points>(1, 3, OntoRim); }

struct Bounded {
  std::string name;
  std::shared_ptr<Oracle> inner, rim;
  double epsilon;
};
void PrintTo(const Bounded& c, std::ostream* out) { *out << c.name; }

class BothNearest : public Live, public ::testing::WithParamInterface<Bounded> {};

TEST_P(BothNearest, TwoOraclesOfNearestPointsWillDo) {
  const auto& [name, inner, rim, epsilon] = GetParam();
  ManifoldWithBoundary oracle(inner, rim);
  const Expected<Mesh> mesh = MeshManifold(oracle, At(epsilon));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(Euler(mesh->simplices), 1);
  EXPECT_EQ(mesh->boundary().size(), 1u);
  EXPECT_EQ(All(mesh->boundary()), Rim(mesh->simplices));
  for (const Ids& simplex : All(mesh->boundary())) {
    const MatrixXd on = mesh->points(Eigen::all, simplex);
    EXPECT_LT((rim->ClosestPoint(on).points - on).norm(), 1e-9);
  }
  EXPECT_LT((inner->ClosestPoint(mesh->points).points - mesh->points).norm(), 1e-7);
  const CheckReport report = Examined(oracle);
  EXPECT_TRUE(report.ok()) << ToText(report);
}

VectorXd OntoDisc(const VectorXd& x) { return x / std::max(1.0, x.norm()); }
VectorXd OntoCircle(const VectorXd& x) { return x.normalized(); }
VectorXd OntoSegment(const VectorXd& x) { return Eigen::Vector2d(std::clamp(x[0], -1.0, 1.0), 0); }
VectorXd OntoEnds(const VectorXd& x) { return Eigen::Vector2d(std::copysign(1, x[0]), 0); }

INSTANTIATE_TEST_SUITE_P(All, BothNearest,
                         ::testing::Values(Bounded{"cap", Cap(), RimOfCap(), 0.25},
                                           Bounded{"disc", std::make_shared<Points>(2, 2, OntoDisc),
                                                   std::make_shared<Points>(1, 2, OntoCircle), 0.2},
                                           Bounded{"segment",
                                                   std::make_shared<Points>(1, 2, OntoSegment),
                                                   std::make_shared<Points>(0, 2, OntoEnds), 0.2}));

class BoundedFromCpp : public Live {};

TEST_F(BoundedFromCpp, AClearanceSaysWhereALargerManifoldEnds) {
  ManifoldWithBoundary oracle(Make("sphere:2"), RimOfCap(),
                              [](const VectorXd& x) { return x[2] - kTall; });
  const Expected<Mesh> mesh = MeshManifold(oracle, At(0.25));
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(mesh->report.certified()) << mesh->report.text;
  EXPECT_EQ(Euler(mesh->simplices), 1);
  EXPECT_TRUE(Examined(oracle).ok()) << ToText(Examined(oracle));
}

TEST_F(BoundedFromCpp, OraclesThatDoNotBelongTogetherAreRefused) {
  const auto refusal = [](std::shared_ptr<Oracle> inner) -> std::string {
    ManifoldWithBoundary oracle(std::move(inner), RimOfCap());
    EXPECT_FALSE(Examined(oracle).ok());
    try {
      const Expected<Mesh> mesh = MeshManifold(oracle, At(0.25));
      return mesh ? "none" : mesh.error().message;
    } catch (const std::runtime_error& failure) {
      return failure.what();
    }
  };
  EXPECT_NE(refusal(Make("sphere:2")).find("do not end at the boundary"), std::string::npos);
  EXPECT_NE(refusal(Make("torus:1:0.4")).find("away from the manifold"), std::string::npos);
  EXPECT_NE(
      refusal(std::make_shared<Points>(2, 3, [](const VectorXd& x) -> VectorXd { return x / 0.0; }))
          .find("closest points have to be finite"),
      std::string::npos);
}

TEST(Bounded, NormalsOfTheBoundaryAreFound) {
  ManifoldWithBoundary oracle(Cap(), RimOfCap());
  const MatrixXd on = RimOfCap()->ClosestPoint(MatrixXd::Random(3, 20)).points;
  MatrixXd down = kTall * on;
  down.row(2).array() -= 1;
  down.colwise().normalize();
  EXPECT_LT((oracle.Conormals(on, {0}) - down).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_LT((oracle.Clearances(on + 0.1 * down).array() + 0.1).abs().maxCoeff(), 1e-2);
  EXPECT_LT(oracle.Clearances(on).cwiseAbs().maxCoeff(), 1e-9);
  const MatrixXd beyond = on + 0.1 * down;  // M goes straight on there
  EXPECT_LT((oracle.ClosestPoint(beyond).points - beyond).norm(), 1e-3);
}

// A disc that ends 1e-5 before, or beyond, where its boundary is said to be.
TEST(Bounded, OraclesThatDisagreeAboutTheEndAreToldByHowMuch) {
  const auto edge = std::make_shared<Points>(1, 2, OntoCircle);
  for (const double radius : {1 - 1e-5, 1 + 1e-5}) {
    const auto disc = std::make_shared<Points>(2, 2, [radius](const VectorXd& x) -> VectorXd {
      return x / std::max(1.0, x.norm() / radius);
    });
    const MatrixXd on = edge->ClosestPoint(MatrixXd::Random(2, 20)).points;
    try {
      ManifoldWithBoundary(disc, edge).Conormals(on, {0});
      ADD_FAILURE() << "nothing is said";
    } catch (const std::runtime_error& told) {
      EXPECT_NE(std::string(told.what()).find("disagree by 1e-05"), std::string::npos)
          << told.what();
      EXPECT_NE(std::string(told.what()).find("take a tolerance of"), std::string::npos);
    }
    ManifoldWithBoundary lenient(disc, edge, {}, 2e-5);
    EXPECT_LT((lenient.Conormals(on, {0}) - on).cwiseAbs().maxCoeff(), 1e-3);
  }
}

TEST(Bounded, BadDeclarationsAreRefused) {
  const auto refusal = [](std::shared_ptr<Oracle> inner, std::shared_ptr<Oracle> rim,
                          double tolerance = 1e-6) -> std::string {
    try {
      ManifoldWithBoundary(std::move(inner), std::move(rim), {}, tolerance);
    } catch (const std::invalid_argument& failure) {
      return failure.what();
    }
    return "none";
  };
  const auto says = [](const std::string& text, const char* words) {
    EXPECT_NE(text.find(words), std::string::npos) << text;
  };
  says(refusal(Cap(), Cap()), "has dimension 1 there, and this has 2");
  says(refusal(nullptr, Cap()), "needs an oracle");
  says(refusal(Cap(), nullptr), "of its boundary");
  says(refusal(Cap(), RimOfCap(), -1), "positive share");
  const auto half =
      std::make_shared<oracles::Clipped>(std::shared_ptr<Oracle>(MakeManifold("sphere:2").value()),
                                         std::vector{oracles::HalfSpace(VectorXd::Unit(3, 0))});
  says(refusal(half, RimOfCap()), "clip it instead");
}

}  // namespace
}  // namespace stellate::testing
