// What an examination says of walls: each broken oracle by the finding that names it.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/examiner.h"
#include "stellate/catalogue.h"
#include "stellate/oracles/walls.h"
#include "tests/core/support/examined.h"

namespace stellate {
namespace {

using core::ExaminationReport, core::Finding, core::Severity;
using Eigen::MatrixXd, Eigen::VectorXd;
using oracles::Ball, oracles::Box, oracles::Clipped, oracles::HalfSpace, oracles::Solid,
    oracles::Wall;
using testing::Examine, testing::Find;

std::shared_ptr<Oracle> Known(const std::string& spec) { return MakeManifold(spec).value(); }
VectorXd Up() { return VectorXd::Unit(3, 2); }

// A sphere cut at z = -0.1, whose answers can be changed.
class Cut final : public Clipped {
 public:
  Cut() : Clipped(Known("sphere:2"), {HalfSpace(Up(), -0.1)}) {}
  Answer FacePoint(const MatrixXd& x, const Walls& face) override {
    Answer answer = Clipped::FacePoint(x, face);
    if (on_face) on_face(x, answer);
    return answer;
  }
  MatrixXd Clearances(const MatrixXd& points) override {
    return Clipped::Clearances(points).array() + off;
  }
  MatrixXd Conormals(const MatrixXd& points, const Walls& face) override {
    MatrixXd conormals = Clipped::Conormals(points, face);
    if (on_conormals) on_conormals(points, conormals);
    return conormals;
  }

  std::function<void(const MatrixXd& x, Answer& answer)> on_face;
  std::function<void(const MatrixXd& points, MatrixXd& conormals)> on_conormals;
  double off = 0;
};

std::unique_ptr<Oracle> With(const std::function<void(Cut&)>& spoil) {
  auto cut = std::make_unique<Cut>();
  spoil(*cut);
  return cut;
}

std::unique_ptr<Oracle> By(std::vector<Wall> walls) {
  return std::make_unique<Clipped>(Known("sphere:2"), std::move(walls));
}

struct BrokenWall {
  std::string code;
  std::function<std::unique_ptr<Oracle>()> make;
};
void PrintTo(const BrokenWall& b, std::ostream* out) { *out << b.code; }

class BrokenWalls : public ::testing::TestWithParam<BrokenWall> {};

TEST_P(BrokenWalls, AreFoundOut) {
  const auto oracle = GetParam().make();
  const ExaminationReport report = Examine(*oracle);
  const Finding* const finding = Find(report, GetParam().code);
  ASSERT_NE(finding, nullptr) << ToText(report);
  EXPECT_EQ(report.ok(), finding->severity != Severity::kError) << ToText(report);
}

INSTANTIATE_TEST_SUITE_P(
    Walls, BrokenWalls,
    ::testing::Values(
        BrokenWall{"NOTHING_LEFT", [] { return By({HalfSpace(Up(), 5)}); }},
        BrokenWall{"FACE_OFF_MANIFOLD",
                   [] {
                     return With([](Cut& o) {
                       o.on_face = [](const MatrixXd&, Answer& answer) {
                         answer.points.array() += 0.01;
                       };
                     });
                   }},
        BrokenWall{"FACE_CLEARANCE", [] { return With([](Cut& o) { o.off = 0.05; }); }},
        BrokenWall{"FACE_NOT_CLOSEST",
                   [] {
                     return With([](Cut& o) {
                       o.on_face = [](const MatrixXd&, Answer& answer) {
                         answer.points.topRows(2) *= -1;
                       };
                     });
                   }},
        BrokenWall{"FACE_MISSED",
                   [] {
                     return With([](Cut& o) {
                       o.on_face = [](const MatrixXd& x, Answer& answer) {
                         std::vector<std::uint8_t> found;
                         for (Eigen::Index j = 0; j < x.cols(); ++j) {
                           const bool is_near = (x - answer.points).col(j).norm() < 0.1;
                           const bool is_off = std::abs(x.col(j).norm() - 1) > 1e-6;
                           found.push_back(answer.IsFound(j) && !(is_near && is_off));
                         }
                         answer.found = std::move(found);
                       };
                     });
                   }},
        BrokenWall{"CONORMAL_NOT_UNIT",
                   [] {
                     return With([](Cut& o) {
                       o.on_conormals = [](const MatrixXd&, MatrixXd& n) { n *= 2; };
                     });
                   }},
        BrokenWall{"CONORMAL_NOT_TANGENT",
                   [] {
                     return With([](Cut& o) {
                       o.on_conormals = [](const MatrixXd& p, MatrixXd& n) {
                         n = 0.96 * n + 0.28 * p;
                       };
                     });
                   }},
        BrokenWall{"CONORMAL_INWARD",
                   [] {
                     return With([](Cut& o) {
                       o.on_conormals = [](const MatrixXd&, MatrixXd& n) { n *= -1; };
                     });
                   }},
        BrokenWall{"CONORMAL_WRONG",
                   [] {
                     return With([](Cut& o) {
                       o.on_conormals = [](const MatrixXd& p, MatrixXd& n) {
                         for (Eigen::Index j = 0; j < n.cols(); ++j) {
                           const Eigen::Vector3d point = p.col(j), right = n.col(j);
                           n.col(j) = 0.8 * right + 0.6 * point.cross(right);
                         }
                       };
                     });
                   }},
        BrokenWall{"WALL_TOUCHES",
                   [] {
                     MatrixXd seeds(3, 2);
                     seeds << 0.6, 0.6, 0, 1, 0.01, 0;
                     return std::make_unique<Clipped>(
                         Known("torus:1:0.4"), std::vector{HalfSpace(VectorXd::Unit(3, 0), 0.6)},
                         seeds);
                   }},
        BrokenWall{"WALLS_TANGENTIAL",
                   [] {
                     const VectorXd tilted = Eigen::Vector3d(0.05, 0, 1);
                     return By({HalfSpace(Up(), -0.1), HalfSpace(tilted, -0.1)});
                   }},
        BrokenWall{"ACUTE_EDGE",
                   [] {
                     const VectorXd flat = Eigen::Vector3d(0, 1, 0),
                                    steep = Eigen::Vector3d(1, -2, 0),
                                    half = VectorXd::Constant(3, 1.3);
                     return std::make_unique<Solid>(
                         std::vector{HalfSpace(flat), HalfSpace(steep), Ball(VectorXd::Zero(3), 1)},
                         BoundingBox{-half, half});
                   }},
        BrokenWall{
            "FACE_NOT_FOUND",
            [] { return By({Wall{[](const VectorXd& x) { return std::pow(x[2] + 0.1, 3); }}}); }},
        BrokenWall{"WALL_CUTS_NOTHING",
                   [] {
                     return By({HalfSpace(Up(), -0.1), HalfSpace(Up(), -5)});
                   }}),
    [](const auto& broken) { return broken.param.code; });

class GoodWalls : public ::testing::TestWithParam<std::string> {};

TEST_P(GoodWalls, Pass) {
  const auto domain = oracles::MakeDomain(GetParam()).value();
  const ExaminationReport report = Examine(*domain);
  const std::set<std::string> harmless = {"REACH", "PIECES", "SPEED", "SLOW", "NOT_CLOSEST_FAR"};
  for (const Finding& finding : report.findings) {
    EXPECT_EQ(harmless.count(finding.code), 1u) << ToText(report);
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, GoodWalls,
                         ::testing::Values("hemisphere", "half-torus", "moebius", "ball", "cube",
                                           "cube:2", "cylinder", "shell", "solid-torus"));

TEST(Walls, TheReachOfABoundaryCounts) {
  const auto ball = oracles::MakeDomain("ball").value();
  EXPECT_NEAR(*Examine(*ball).reach, 1, 1e-6);
  Cut cut;
  EXPECT_NEAR(*Examine(cut).reach, std::sqrt(0.99), 1e-6);
}

}  // namespace
}  // namespace stellate
