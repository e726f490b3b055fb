// What is no manifold at some place, served as if it were one: the run ends soon, and names what
// there is and where. What is smooth, however sharply it bends, is never called creased.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/run/crease_watch.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using Eigen::Vector3d;
using testing::Drive;
using testing::DrivenRun;

bool HasWords(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

// What may be the closest point: where it is on M at all, and the directions normal to M there, one
// for a surface and two for a curve.
struct Candidate {
  Vector3d point;
  std::vector<Vector3d> normals;
};
// In R^3, as all the candidates for a point that there are: the nearest is the answer.
struct Shape {
  std::string name;
  int k = 2;
  std::function<std::vector<Candidate>(const Vector3d&)> candidates;
  // How far a point is from the nearest place that is not smooth.
  std::function<double(const Vector3d&)> off = {};
  // Whether a point that is not smooth can be an answer. Where gradients lead to the surface, they
  // may fail on an edge, and find nothing.
  bool finds_edges = true;
};
void PrintTo(const Shape& s, std::ostream* out) { *out << s.name; }

Candidate ClosestOf(const Shape& shape, const Vector3d& x) {
  Candidate best{Vector3d::Zero(), {}};
  double least = INFINITY;
  for (Candidate& c : shape.candidates(x)) {
    const double distance = (c.point - x).norm();
    if (distance >= least) continue;
    least = distance;
    best = std::move(c);
  }
  return best;
}

AnswerBlock AnswerOf(const Shape& shape, const QueryBlock& block) {
  AnswerBlock answer;
  answer.points = block.points;
  if (block.want.tangents) answer.tangents.resize(3 * shape.k, block.size());
  if (!shape.finds_edges) answer.found.assign(static_cast<std::size_t>(block.size()), 1);
  for (Eigen::Index j = 0; j < block.size(); ++j) {
    const Candidate found = ClosestOf(shape, block.points.col(j));
    answer.points.col(j) = found.point;
    if (!shape.finds_edges && shape.off(found.point) == 0)
      answer.found[static_cast<std::size_t>(j)] = 0;
    if (!block.want.tangents) continue;
    Eigen::MatrixXd normals(3, 3 - shape.k);
    for (int a = 0; a < 3 - shape.k; ++a) normals.col(a) = found.normals[static_cast<size_t>(a)];
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(normals).householderQ();
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < shape.k; ++a) answer.tangents(i * shape.k + a, j) = q(i, 3 - shape.k + a);
  }
  return answer;
}

Specification SpecOf(const Shape& shape, double epsilon, bool tangents, std::uint64_t seed) {
  Specification spec;
  spec.dimension = shape.k;
  spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  spec.oracle.tangent_basis = tangents;
  spec.random_seed = seed;
  spec.bounding_box = BoundingBox{Vector3d::Constant(-2.5), Vector3d::Constant(2.5)};
  return spec;
}

DrivenRun MeshOf(const Shape& shape, const Specification& spec) {
  return Drive(spec, [&shape](const QueryBatch& batch) {
    Answers answers;
    for (const QueryBlock& block : batch.blocks) answers.blocks.push_back(AnswerOf(shape, block));
    return answers;
  });
}

// The border of what two unit balls have together, or in common; the second about (0, 0, apart).
Shape TwoBalls(bool together, double apart) {
  const double half = apart / 2, radius = std::sqrt(1 - half * half);
  const auto ring = [=](const Vector3d& x) -> Vector3d {
    const Vector3d along = Vector3d(x[0], x[1], 0).normalized();
    return radius * along + half * Vector3d::UnitZ();
  };
  Shape shape{together ? "union of balls" : "lens", 2, {}, {}};
  shape.candidates = [=](const Vector3d& x) {
    std::vector<Candidate> all;
    for (const double z : {0.0, apart}) {
      const Vector3d centre = z * Vector3d::UnitZ(), other = (apart - z) * Vector3d::UnitZ();
      const Vector3d normal = (x - centre).normalized(), y = centre + normal;
      if (((y - other).norm() >= 1) == together) all.push_back({y, {normal}});
    }
    const Vector3d y = ring(x);
    all.push_back({y, {y}});
    return all;
  };
  shape.off = [=](const Vector3d& x) { return (ring(x) - x).norm(); };
  return shape;
}

// The lens, its edge rounded by `round`: what lies so far around the lens.
Shape RoundedLens(double apart, double round) {
  const Shape lens = TwoBalls(false, apart);
  return {"rounded lens", 2, [=](const Vector3d& x) {
            const Candidate at = ClosestOf(lens, x);
            const bool inside = x.norm() < 1 && (x - apart * Vector3d::UnitZ()).norm() < 1;
            Vector3d normal = (x - at.point).normalized();
            if (inside) normal = -normal;
            return std::vector<Candidate>{{at.point + round * normal, {normal}}};
          }};
}

Shape SharpBox() {
  return {"box", 2,
          [](const Vector3d& x) {
            const Vector3d half(1, 1, 0.3);
            std::vector<Candidate> faces;
            for (int i = 0; i < 3; ++i)
              for (const double side : {-1.0, 1.0}) {
                Vector3d y = x.cwiseMax(-half).cwiseMin(half);
                y[i] = side * half[i];
                faces.push_back({y, {Vector3d::Unit(i)}});
              }
            return faces;
          },
          [](const Vector3d& x) {  // from the nearest edge: two coordinates are at their ends
            Vector3d gap = (x.cwiseAbs() - Vector3d(1, 1, 0.3)).cwiseAbs();
            std::sort(gap.begin(), gap.end());
            return std::hypot(gap[0], gap[1]);
          }};
}

Shape BoxWithoutEdges() {
  Shape shape = SharpBox();
  shape.name = "box without edges";
  shape.finds_edges = false;
  return shape;
}

// |x| + |y| = 1 in the plane z = 0: a closed curve with four corners.
Shape Square() {
  return {"square", 1,
          [](const Vector3d& x) {
            std::vector<Candidate> sides;
            for (const double i : {-1.0, 1.0})
              for (const double j : {-1.0, 1.0}) {
                const double at = std::clamp((1 + i * x[0] - j * x[1]) / 2, 0.0, 1.0);
                sides.push_back({Vector3d(i * at, j * (1 - at), 0),
                                 {Vector3d(i, j, 0).normalized(), Vector3d::UnitZ()}});
              }
            return sides;
          },
          [](const Vector3d& x) {
            return std::min(std::hypot(std::abs(x[0]) - 1, x[1]),
                            std::hypot(x[0], std::abs(x[1]) - 1));
          }};
}

// The shape with first normals that are differences of f over `step`, as those of a client without
// derivatives: nearer to an edge than that they mix both sides.
Shape ByDifferences(Shape shape, double step, std::function<double(const Vector3d&)> f) {
  shape.name += " by differences";
  shape.candidates = [step, f = std::move(f), of = shape.candidates](const Vector3d& x) {
    std::vector<Candidate> all = of(x);
    for (Candidate& c : all)
      for (int i = 0; i < 3; ++i) {
        const Vector3d along = step * Vector3d::Unit(i);
        c.normals[0][i] = (f(c.point + along) - f(c.point - along)) / (2 * step);
      }
    return all;
  };
  return shape;
}

Shape SquareByDifferences(double step) {
  return ByDifferences(Square(), step,
                       [](const Vector3d& x) { return std::abs(x[0]) + std::abs(x[1]); });
}

Shape BoxByDifferences(double step) {
  return ByDifferences(SharpBox(), step, [](const Vector3d& x) {
    return (x.cwiseAbs() - Vector3d(1, 1, 0.3)).maxCoeff();
  });
}

// Unit circles about the origin, in two planes that meet in the first axis.
Shape CrossingCircles() {
  return {"crossing circles", 1,
          [](const Vector3d& x) {
            std::vector<Candidate> all;
            for (const double lean : {1.0, -1.0}) {
              const Vector3d normal = Vector3d(0, 1, lean).normalized();
              const Vector3d y = (x - normal * normal.dot(x)).normalized();
              all.push_back({y, {normal, y}});
            }
            return all;
          },
          [](const Vector3d& x) {
            return std::min((x - Vector3d::UnitX()).norm(), (x + Vector3d::UnitX()).norm());
          }};
}

// Whole spheres.
Shape CrossingSpheres() {
  const double apart = 1.2;
  Shape shape{"crossing spheres", 2,
              [=](const Vector3d& x) {
                std::vector<Candidate> all;
                for (const double z : {0.0, apart}) {
                  const Vector3d centre = z * Vector3d::UnitZ();
                  const Vector3d normal = (x - centre).normalized();
                  all.push_back({centre + normal, {normal}});
                }
                return all;
              },
              TwoBalls(true, apart).off};
  return shape;
}

// A surface of revolution, from the candidates in the half plane of a point, (r, z), each with its
// normal there; r < 0 is on the other side of the axis.
struct OfProfile {
  double r, z, nr, nz;
};
Shape Revolved(const std::string& name,
               std::function<std::vector<OfProfile>(double, double)> profile,
               const std::vector<double>& tips) {
  return {name, 2,
          [profile = std::move(profile)](const Vector3d& x) {
            const double r = std::hypot(x[0], x[1]);
            const Vector3d out =
                r > 0 ? Vector3d(x[0] / r, x[1] / r, 0) : Vector3d(Vector3d::UnitX());
            std::vector<Candidate> all;
            for (const OfProfile& c : profile(r, x[2]))
              all.push_back(
                  {c.r * out + c.z * Vector3d::UnitZ(), {c.nr * out + c.nz * Vector3d::UnitZ()}});
            return all;
          },
          [tips](const Vector3d& x) {
            double off = INFINITY;
            for (const double z : tips) off = std::min(off, (x - z * Vector3d::UnitZ()).norm());
            return off;
          }};
}

// A cone around the unit ball, whose sides are at an angle of `half` degrees to its axis.
Shape Cone(double half) {
  const double s = std::sin(half * std::numbers::pi / 180),
               c = std::cos(half * std::numbers::pi / 180);
  return Revolved("cone with a tip of " + std::to_string(half),
                  [s, c](double r, double z) {
                    const double along =
                        std::clamp(s * r + c * (1 / s - z), 0.0, c / s);  // from the tip
                    std::vector<OfProfile> all{{s * along, 1 / s - c * along, c, s}};
                    const double away = std::hypot(r, z);
                    if (z <= s * away) all.push_back({r / away, z / away, r / away, z / away});
                    return all;
                  },
                  {1 / s});
}

// The unit circle about (0.5, 0), revolved: the outer part, with two dimples, the inner part, with
// two tips, or both, which cross each other there.
Shape Spindle(bool outer, bool inner) {
  const double tip = std::sqrt(0.75);
  return Revolved(outer && inner ? "crossing spindle"
                  : outer        ? "apple with a tip"
                                 : "lemon with a tip",
                  [=](double r, double z) {
                    std::vector<OfProfile> all;
                    for (const double centre : {0.5, -0.5}) {
                      if (!(centre > 0 ? outer : inner)) continue;
                      const double away = std::hypot(r - centre, z);
                      const double nr = (r - centre) / away, nz = z / away;
                      if (centre + nr >= 0) all.push_back({centre + nr, nz, nr, nz});
                    }
                    for (const double end : {-tip, tip}) all.push_back({0, end, 0, 1});
                    return all;
                  },
                  {-tip, tip});
}

class Creases : public ::testing::TestWithParam<std::tuple<Shape, bool>> {};

TEST_P(Creases, EndTheRunSoonWithTheirPlace) {
  const auto& [shape, tangents] = GetParam();
  for (const double epsilon : {0.2, 0.1})
    for (const std::uint64_t seed : {2, 3}) {
      SCOPED_TRACE(::testing::Message() << "epsilon " << epsilon << ", seed " << seed);
      const DrivenRun run = MeshOf(shape, SpecOf(shape, epsilon, tangents, seed));
      const Certificate& certificate = run.report().certificate;
      EXPECT_FALSE(certificate.certified);
      EXPECT_FALSE(certificate.only_too_coarse) << "no epsilon will do";
      EXPECT_LE(run.report().counts.rounds, 300u);
      const std::string words = HasWords(shape.name, "crossing")
                                    ? "crosses itself or is singular near ("
                                    : "has a crease or a tip near (";
      const std::string& verdict = certificate.verdict;
      const std::size_t at = verdict.find(words);
      ASSERT_NE(at, std::string::npos) << verdict;
      EXPECT_TRUE(HasWords(verdict, "no epsilon will do")) << verdict;
      EXPECT_FALSE(HasWords(verdict, "smaller epsilon") || HasWords(verdict, "take epsilon"))
          << verdict;
      for (const std::string& warning : certificate.warnings)
        EXPECT_FALSE(HasWords(warning, "take epsilon")) << warning;
      Vector3d place;
      ASSERT_EQ(std::sscanf(verdict.c_str() + at + words.size(), "%lf, %lf, %lf", &place[0],
                            &place[1], &place[2]),
                3);
      EXPECT_LT(shape.off(place), 0.02 * epsilon) << verdict;
    }
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, Creases,
    ::testing::Combine(::testing::Values(TwoBalls(true, 1), TwoBalls(false, 1), SharpBox(),
                                         BoxWithoutEdges(), Square(), SquareByDifferences(2e-3),
                                         SquareByDifferences(2e-5), BoxByDifferences(2e-3),
                                         CrossingCircles(), CrossingSpheres(), Cone(30), Cone(45),
                                         Cone(50), Spindle(true, false), Spindle(false, true),
                                         Spindle(true, true)),
                       ::testing::Bool()));

// An edge that is rounded by a thousandth of the mesh size, and tubes and gaps far below it.
TEST(SmoothManifolds, AreNeverCalledCreased) {
  std::vector<std::pair<std::string, std::string>> verdicts;
  for (const double round : {1e-1, 1e-2, 1e-3}) {
    Specification spec = SpecOf(RoundedLens(1, 0.2 * round), 0.2, true, 1);
    spec.limits.max_vertices = 3000;
    for (const bool tangents : {true, false}) {
      if (!tangents && round < 1e-2) continue;  // below the steps of differences
      spec.oracle.tangent_basis = tangents;
      verdicts.emplace_back("rounded by " + std::to_string(round),
                            MeshOf(RoundedLens(1, 0.2 * round), spec).report().certificate.verdict);
    }
  }
  for (const char* const name :
       {"torus:1:0.05", "torus:1:0.02", "ellipsoid:1:1:0.02", "torus-knot:2:9", "so3"}) {
    const auto manifold = testing::Make(name);
    for (const double epsilon : {0.3, 1.0}) {
      Specification spec = testing::SpecificationFor(*manifold, epsilon);
      spec.limits.max_vertices = 3000;
      verdicts.emplace_back(name, Drive(spec, *manifold).report().certificate.verdict);
    }
  }
  for (const auto& [name, verdict] : verdicts)
    EXPECT_FALSE(HasWords(verdict, "crease") || HasWords(verdict, "crosses"))
        << name << ": " << verdict;
}

// Points that are off by noise have tangents that differ at random, on no two sides.
TEST(SmoothManifolds, AreNotCalledCreasedForTheirNoise) {
  const auto sphere = testing::Make("sphere:2");
  for (const double noise : {1e-9, 1e-7, 1e-5}) {
    Specification spec = testing::SpecificationFor(*sphere, 0.3);
    spec.oracle = {};
    spec.limits.max_vertices = 2000;
    spec.limits.max_rounds = 400;
    const auto answer = [&](const QueryBatch& batch) {
      Answers answers = testing::AnswersOf(*sphere, batch);
      for (AnswerBlock& block : answers.blocks)
        for (Eigen::Index j = 0; j < block.points.cols(); ++j) {
          auto point = block.points.col(j);
          std::uint64_t key = 0;
          for (const double x : point) key = Mix64(key ^ std::bit_cast<std::uint64_t>(x));
          point *= 1 + noise * (Random(key).Uniform() - 0.5);
        }
      return answers;
    };
    const std::string verdict = Drive(spec, answer).report().certificate.verdict;
    EXPECT_FALSE(HasWords(verdict, "crease") || HasWords(verdict, "crosses"))
        << noise << ": " << verdict;
  }
}

TEST(CreaseWatch, WaitsForRoundsThatMendNothing) {
  CreaseWatch watch;
  for (int round = 0; round < 200; ++round)
    EXPECT_FALSE(watch.IsDue(std::uint64_t{1000} >> (round / 10), true)) << "halved every ten";
  CreaseWatch stuck;
  int due = 0;
  for (int round = 0; round < 200; ++round) due += stuck.IsDue(100, true);
  EXPECT_GE(due, 2);
  EXPECT_LE(due, 4) << "ever more seldom";
  CreaseWatch growing;
  for (int round = 0; round < 90; ++round) {
    growing.NoteFrontMoved();
    EXPECT_FALSE(growing.IsDue(100 + static_cast<std::uint64_t>(round), false));
  }
}

}  // namespace
}  // namespace stellate::core
