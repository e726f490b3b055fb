#pragma once

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
