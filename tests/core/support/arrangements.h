#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/core/support/domain.h"

namespace stellate::testing {

// A domain whose walls have labels, and what is known of its regions.
struct Arrangement {
  std::string name;
  Domain domain;
  std::function<int(core::WallSet signs)> label;
  std::map<int, int> euler;  // of each region
  double epsilon = 0.3;      // a share of the reach of all walls that is fine enough

  core::Specification SpecificationFor(double eps) const {
    core::Specification spec = domain.SpecificationFor(eps);
    for (core::WallSet signs = 0; signs < core::SetOfWall(spec.walls); ++signs)
      spec.labels.push_back(static_cast<std::int8_t>(label(signs)));
    return spec;
  }
};

inline bool AllOf(core::WallSet signs, int first, int end) {
  const core::WallSet walls = core::SetOfWall(end) - core::SetOfWall(first);
  return core::IsSubset(walls, signs);
}

// The unit ball around a centre, in `count` of the coordinates.
inline Domain::Function InBall(Eigen::VectorXd centre, double radius) {
  const auto d = static_cast<int>(centre.size());
  return BallOf(std::move(centre), radius, -1, d);
}

// The walls of a box, positive inside: lower and upper of each coordinate.
inline std::vector<Domain::Function> InBox(int d, double half) {
  std::vector<Domain::Function> walls;
  for (int i = 0; i < d; ++i)
    for (const double sign : {1.0, -1.0})
      walls.push_back(HalfSpaceOf(sign * Eigen::VectorXd::Unit(d, i), half));
  return walls;
}

inline Arrangement OfBalls(int d, std::string name, std::function<int(core::WallSet)> label,
                           std::map<int, int> euler) {
  Arrangement a;
  a.name = std::move(name);
  a.domain.k = a.domain.d = d;
  a.domain.box = CubeOf(d, 1.6);
  a.domain.walls = {InBall(-0.5 * Eigen::VectorXd::Unit(d, 0), 1),
                    InBall(0.5 * Eigen::VectorXd::Unit(d, 0), 1)};
  a.label = std::move(label);
  a.euler = std::move(euler);
  return a;
}

// Phases: at each point that one of which the function is the largest, cut by further walls, all of
// which are positive inside. Wall by wall i < j: f_i - f_j; label i + 1.
inline Arrangement PhasesOf(int k, std::vector<Domain::Function> functions,
                            std::vector<Domain::Function> cuts) {
  const auto n = static_cast<int>(functions.size());
  Arrangement a;
  std::vector<std::vector<int>> wall(functions.size(), std::vector<int>(functions.size()));
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j) {
      wall[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] =
          static_cast<int>(a.domain.walls.size());
      a.domain.walls.push_back(
          [f = functions[static_cast<std::size_t>(i)], g = functions[static_cast<std::size_t>(j)]](
              const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
            Eigen::VectorXd other(x.size());
            const double value = f(x, gradient) - g(x, gradient ? &other : nullptr);
            if (gradient) *gradient -= other;
            return value;
          });
    }
  std::vector<core::WallSet> sets;
  const auto set = [wall](int i, int j) {
    return core::SetOfWall(wall[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]);
  };
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j)
      for (int h = j + 1; h < n; ++h) sets.push_back(set(i, j) | set(i, h) | set(j, h));
  a.domain.closures = core::Closures(std::move(sets));
  const auto pairs = static_cast<int>(a.domain.walls.size());
  for (auto& cut : cuts) a.domain.walls.push_back(std::move(cut));
  const auto all = static_cast<int>(a.domain.walls.size());
  a.domain.k = k;
  // An order of the phases beats each other differently often: 0 to n - 1 times.
  a.label = [=](core::WallSet signs) {
    std::vector<int> beats(static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j)
        ++beats[static_cast<std::size_t>(core::IsSubset(set(i, j), signs) ? i : j)];
    std::vector<int> sorted = beats;
    std::sort(sorted.begin(), sorted.end());
    for (int i = 0; i < n; ++i)
      if (sorted[static_cast<std::size_t>(i)] != i) return -1;
    if (!AllOf(signs, pairs, all)) return 0;
    return static_cast<int>(std::find(beats.begin(), beats.end(), n - 1) - beats.begin()) + 1;
  };
  for (int i = 1; i <= n; ++i) a.euler[i] = 1;
  return a;
}

// -|x - centre|^2 / 2, bent a little: the walls between two such are no planes.
inline Domain::Function NearTo(Eigen::VectorXd centre, double bend) {
  return [=](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    const Eigen::VectorXd off = x - centre;
    if (gradient) {
      *gradient = -off;
      (*gradient)[0] -= bend * std::sin(2 * x[0]);
    }
    return -off.squaredNorm() / 2 + bend / 2 * std::cos(2 * x[0]);
  };
}

// Three phases that meet in an edge, or four that meet in a point, in the unit ball of R^d.
inline std::vector<Arrangement> PhaseArrangements() {
  std::vector<Arrangement> all;
  for (const int d : {2, 3}) {
    std::vector<Domain::Function> functions;
    for (int i = 0; i < 3; ++i) {
      Eigen::VectorXd centre = Eigen::VectorXd::Zero(d);
      centre[0] = std::cos(2.1 * i + 0.2) + 0.05 * i;
      centre[1] = std::sin(2.1 * i + 0.2);
      functions.push_back(NearTo(centre, i == 1 ? 0.25 : 0));
    }
    all.push_back(PhasesOf(d, functions, {InBall(Eigen::VectorXd::Zero(d), 1)}));
    all.back().name = "Three";
  }
  std::vector<Domain::Function> four;
  for (const Eigen::Vector3d& centre : {Eigen::Vector3d(1, 1, 1.1), Eigen::Vector3d(1, -1, -1),
                                        Eigen::Vector3d(-1, 1, -0.9), Eigen::Vector3d(-1, -1.1, 1)})
    four.push_back(NearTo(centre, four.size() == 1 ? 0.25 : 0));
  all.push_back(PhasesOf(3, four, {InBall(Eigen::Vector3d::Zero(), 1)}));
  all.back().name = "Four";
  for (Arrangement& a : all) {
    a.domain.d = a.domain.k;
    a.domain.box = CubeOf(a.domain.d, 1.2);
    a.name += "PhasesInDimension" + std::to_string(a.domain.k);
  }
  return all;
}

// Three functions that are the largest in a third of space each, around an axis.
inline std::vector<Domain::Function> ThirdsAround(int first, int second) {
  std::vector<Domain::Function> functions;
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d towards = Eigen::Vector3d::Zero();
    towards[first] = std::cos(2.1 * i + 0.2);
    towards[second] = std::sin(2.1 * i + 0.2);
    functions.push_back(HalfSpaceOf(towards, 0));
  }
  return functions;
}

// A solid torus in three pieces around its axis, where the phases' own edge is outside of it.
inline Arrangement PhasesInTorus() {
  Arrangement a = PhasesOf(3, ThirdsAround(0, 1), {TorusOf(-1)});
  a.name = "ThreePhasesInTorus";
  a.domain.d = 3;
  a.domain.box = CubeOf(3, 1.6);
  a.epsilon = 0.12;
  return a;
}

// A torus, a surface, on which three phases meet in four points and at no place end.
inline Arrangement PhasesOnTorus() {
  Arrangement a = PhasesOf(2, ThirdsAround(1, 2), {});
  a.name = "ThreePhasesOnTorus";
  a.domain.d = 3;
  a.domain.equations = {TorusOf()};
  a.domain.box = CubeOf(3, 1.6);
  a.euler.clear();
  a.epsilon = 0.08;
  return a;
}

// sin x cos y + sin y cos z + sin z cos x, turned with the box that it is in.
inline Domain::Function GyroidOf() {
  return [](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    const Eigen::Array3d s = x.array().sin(), c = x.array().cos();
    if (gradient)
      *gradient = Eigen::Vector3d(c[0] * c[1] - s[2] * s[0], c[1] * c[2] - s[0] * s[1],
                                  c[2] * c[0] - s[1] * s[2]);
    return s[0] * c[1] + s[1] * c[2] + s[2] * c[0];
  };
}

// More walls than three pass through some corners.
inline std::vector<Arrangement> CrowdedArrangements() {
  std::vector<Arrangement> all;
  {
    Arrangement a;
    a.name = "OctahedronWithGrain";
    for (int i = 0; i < 8; ++i)
      a.domain.walls.push_back(HalfSpaceOf(
          Eigen::Vector3d((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1) /
              std::sqrt(3.0),
          1 / std::sqrt(3.0)));
    a.domain.walls.push_back(InBall(Eigen::Vector3d(0.05, 0, 0.02), 0.3));
    a.domain.box = CubeOf(3, 1.1);
    a.label = [](auto s) { return !AllOf(s, 0, 8) ? 0 : AllOf(s, 8, 9) ? 2 : 1; };
    a.euler = {{1, 2}, {2, 1}};
    a.epsilon = 0.12;
    all.push_back(a);
  }
  {
    Arrangement a;
    a.name = "PyramidWithGrain";
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(-1, 0), Eigen::Vector2d(1, 0),
                                        Eigen::Vector2d(0, -1), Eigen::Vector2d(0, 1)})
      a.domain.walls.push_back(
          HalfSpaceOf(Eigen::Vector3d(side[0], side[1], -0.6).normalized(), 0.7));
    a.domain.walls.push_back(HalfSpaceOf(Eigen::Vector3d(0.1, 0, 1).normalized(), 0.5));
    a.domain.walls.push_back(InBall(Eigen::Vector3d(0, 0, 0.1), 0.4));
    a.domain.box = CubeOf(3, 1.9);
    a.label = [](auto s) { return !AllOf(s, 0, 5) ? 0 : AllOf(s, 5, 6) ? 2 : 1; };
    a.euler = {{1, 2}, {2, 1}};
    a.epsilon = 0.2;
    all.push_back(a);
  }
  {
    // The gyroid passes through all corners of its cell: it cuts some, touches others, and in some
    // M is on one side of it alone.
    Arrangement a;
    a.name = "AlignedGyroid";
    a.domain.walls = {GyroidOf()};
    const double half = std::acos(-1.0);
    for (const auto& side : InBox(3, half)) a.domain.walls.push_back(side);
    a.domain.box = CubeOf(3, half + 0.1);
    a.label = [](auto s) { return !AllOf(s, 1, 7) ? 0 : AllOf(s, 0, 1) ? 1 : 2; };
    a.epsilon = 0.3;
    all.push_back(a);
  }
  for (Arrangement& a : all) a.domain.k = a.domain.d = 3;
  return all;
}

// Two balls without what they have in common: the rest touches itself along a circle.
inline Arrangement Pinched(int d) {
  return OfBalls(d, "Pinched", [](auto s) { return s == 1 || s == 2 ? 1 : 0; }, {});
}

inline std::vector<Arrangement> PlaneArrangements() {
  std::vector<Arrangement> all;
  all.push_back(OfBalls(2, "Union", [](auto s) { return s != 0 ? 1 : 0; }, {{1, 1}}));
  all.push_back(OfBalls(2, "Difference", [](auto s) { return s == 1 ? 1 : 0; }, {{1, 1}}));
  all.push_back(
      OfBalls(2, "Venn", [](auto s) { return static_cast<int>(s); }, {{1, 1}, {2, 1}, {3, 1}}));
  {
    Arrangement a;
    a.name = "Inclusion";
    a.domain.k = a.domain.d = 2;
    a.domain.box = CubeOf(2, 1.2);
    a.domain.walls = InBox(2, 1);
    a.domain.walls.push_back(InBall(Eigen::Vector2d(0.1, 0.05), 0.4));
    a.label = [](auto s) { return !AllOf(s, 0, 4) ? 0 : AllOf(s, 4, 5) ? 2 : 1; };
    a.euler = {{1, 0}, {2, 1}};
    a.epsilon = 0.12;
    all.push_back(a);
  }
  {
    Arrangement a;
    a.name = "TJunctions";
    a.domain.k = a.domain.d = 2;
    a.domain.box = CubeOf(2, 1.2);
    a.domain.walls = {InBall(Eigen::Vector2d(0, 0), 1),
                      HalfSpaceOf(Eigen::Vector2d(0.1, 1).normalized(), -0.05),
                      InBall(Eigen::Vector2d(-2, -0.5), 2.1)};
    a.label = [](auto s) { return (s & 1) == 0 ? 0 : (s & 2) != 0 ? 1 : (s & 4) != 0 ? 2 : 3; };
    a.euler = {{1, 1}, {2, 1}, {3, 1}};
    all.push_back(a);
  }
  {
    Arrangement a;
    a.name = "LShape";
    a.domain.k = a.domain.d = 2;
    a.domain.box = CubeOf(2, 1.2);
    a.domain.walls = InBox(2, 1);
    a.domain.walls.push_back(HalfSpaceOf(Eigen::Vector2d(1, 0), -0.1));
    a.domain.walls.push_back(HalfSpaceOf(Eigen::Vector2d(0, 1), -0.2));
    a.label = [](auto s) { return AllOf(s, 0, 4) && !AllOf(s, 4, 6) ? 1 : 0; };
    a.euler = {{1, 1}};
    all.push_back(a);
  }
  {
    Arrangement a;
    a.name = "TwoColouredTorus";
    a.domain.k = 2;
    a.domain.d = 4;
    a.domain.box = CubeOf(4, 1.2);
    for (const int first : {0, 2})
      a.domain.equations.push_back([first](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
        if (gradient) {
          gradient->setZero(4);
          gradient->segment(first, 2) = x.segment(first, 2);
        }
        return (x.segment(first, 2).squaredNorm() - 1) / 2;
      });
    a.domain.walls = {HalfSpaceOf(Eigen::Vector4d(1, 0, 0.5, 0).normalized(), -0.1),
                      HalfSpaceOf(Eigen::Vector4d(0, 1, 0, 1).normalized(), -0.2)};
    a.label = [](auto s) { return s == 3 ? 2 : s != 0 ? 1 : 0; };
    all.push_back(a);
  }
  return all;
}

inline std::vector<Arrangement> SpaceArrangements() {
  std::vector<Arrangement> all;
  all.push_back(OfBalls(3, "Union", [](auto s) { return s != 0 ? 1 : 0; }, {{1, 1}}));
  all.push_back(OfBalls(3, "Difference", [](auto s) { return s == 1 ? 1 : 0; }, {{1, 1}}));
  all.push_back(OfBalls(3, "Lens", [](auto s) { return s == 3 ? 1 : 0; }, {{1, 1}}));
  all.push_back(OfBalls(3, "LensInBall", [](auto s) { return s == 3   ? 2
                                                             : s == 1 ? 1
                                                                      : 0; },
                        {{1, 1}, {2, 1}}));
  all.push_back(
      OfBalls(3, "Overlap", [](auto s) { return s == 3   ? 2
                                                : s != 0 ? 1
                                                         : 0; }, {{2, 1}}));
  all.push_back(
      OfBalls(3, "Venn", [](auto s) { return static_cast<int>(s); }, {{1, 1}, {2, 1}, {3, 1}}));
  const auto with_cube = [&](std::string name, Domain::Function ball, auto label,
                             std::map<int, int> euler) {
    Arrangement a;
    a.name = std::move(name);
    a.domain.k = a.domain.d = 3;
    a.domain.box = CubeOf(3, 1.6);
    a.domain.walls = InBox(3, 1);
    a.domain.walls.push_back(std::move(ball));
    a.label = label;
    a.euler = std::move(euler);
    a.epsilon = 0.25;
    all.push_back(a);
  };
  const Domain::Function corner = InBall(Eigen::Vector3d(0.9, 0.8, 0.95), 0.7);
  with_cube("CubeMinusBall", corner,
            [](core::WallSet s) { return AllOf(s, 0, 6) && !AllOf(s, 6, 7) ? 1 : 0; }, {{1, 1}});
  with_cube("CubePlusBall", corner,
            [](core::WallSet s) { return AllOf(s, 0, 6) || AllOf(s, 6, 7) ? 1 : 0; }, {{1, 1}});
  with_cube("BallInCube", InBall(Eigen::Vector3d(0.1, 0.05, -0.1), 0.6),
            [](core::WallSet s) { return !AllOf(s, 0, 6)  ? 0
                                         : AllOf(s, 6, 7) ? 2
                                                          : 1; },
            {{1, 2}, {2, 1}});
  {
    Arrangement a;
    a.name = "BallAndCylinder";
    a.domain.k = a.domain.d = 3;
    a.domain.box = CubeOf(3, 1.8);
    a.domain.walls = {
        InBall(Eigen::Vector3d::Zero(), 1), BallOf(Eigen::Vector3d(0.1, 0.1, 0), 0.4, -1, 2),
        HalfSpaceOf(Eigen::Vector3d(0, 0, 1), 1.6), HalfSpaceOf(Eigen::Vector3d(0, 0, -1), 1.6)};
    a.label = [](auto s) { return AllOf(s, 0, 1) || AllOf(s, 1, 4) ? 1 : 0; };
    a.euler = {{1, 1}};
    a.epsilon = 0.16;
    all.push_back(a);
  }
  return all;
}

}  // namespace stellate::testing
