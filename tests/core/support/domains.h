#pragma once

#include "tests/core/support/domain.h"

namespace stellate::testing {

// Manifolds with boundary whose topology is known. Walls meet at 90 degrees, if at all.

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

inline Domain Make(int k, int d, double half, int euler, std::size_t boundary_components) {
  Domain m;
  m.k = k;
  m.d = d;
  m.box = CubeOf(d, half);
  m.euler = euler;
  m.boundary_components = boundary_components;
  return m;
}

inline Domain Arc() {
  Domain m = Make(1, 2, 1.3, 1, 2);
  m.equations = {BallOf(Vector2d::Zero(), 1, 1, 2)};
  m.walls = {HalfSpaceOf(Vector2d(1, 0.3), 0.4)};
  return m;
}

inline Domain Hemisphere() {
  Domain m = Make(2, 3, 1.3, 1, 1);
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  m.walls = {HalfSpaceOf(Vector3d(0.2, 0.3, 1), 0.1)};
  return m;
}

inline Domain HalfTorus() {
  Domain m = Make(2, 3, 1.6, 0, 2);
  m.equations = {TorusOf()};
  m.walls = {HalfSpaceOf(Vector3d(1, 0.1, 0.2), 0.05)};
  return m;
}

inline Domain Octant() {
  Domain m = Make(2, 3, 1.3, 1, 1);
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  for (int i = 0; i < 3; ++i) m.walls.push_back(HalfSpaceOf(Vector3d::Unit(i), 0));
  return m;
}

inline Domain Disc() {
  Domain m = Make(2, 2, 1.3, 1, 1);
  m.walls = {BallOf(Vector2d::Zero(), 1, -1, 2)};
  return m;
}

inline Domain Annulus() {
  Domain m = Make(2, 2, 1.3, 0, 2);
  m.walls = {BallOf(Vector2d::Zero(), 1, -1, 2), BallOf(Vector2d(0.1, 0), 0.4, 1, 2)};
  return m;
}

inline Domain HalfClifford() {
  Domain m = Make(2, 4, 1.3, 0, 2);
  m.equations = {[](const VectorXd& p, VectorXd* g) {
                   if (g) *g = (VectorXd(4) << 2 * p[0], 2 * p[1], 0, 0).finished();
                   return p[0] * p[0] + p[1] * p[1] - 1;
                 },
                 [](const VectorXd& p, VectorXd* g) {
                   if (g) *g = (VectorXd(4) << 0, 0, 2 * p[2], 2 * p[3]).finished();
                   return p[2] * p[2] + p[3] * p[3] - 1;
                 }};
  m.walls = {HalfSpaceOf((VectorXd(4) << 1, 0.2, 0, 0).finished(), 0.1)};
  return m;
}

// One lump of it: sin x cos y + sin y cos z + sin z cos x = 0 in a box of about a third of a
// period.
inline Domain GyroidInABox() {
  Domain m = Make(2, 3, 1.3, 1, 1);
  m.equations = {[](const VectorXd& p, VectorXd* g) {
    using std::cos, std::sin;
    if (g)
      *g = Vector3d(cos(p[0]) * cos(p[1]) - sin(p[2]) * sin(p[0]),
                    cos(p[1]) * cos(p[2]) - sin(p[0]) * sin(p[1]),
                    cos(p[2]) * cos(p[0]) - sin(p[1]) * sin(p[2]));
    return sin(p[0]) * cos(p[1]) + sin(p[1]) * cos(p[2]) + sin(p[2]) * cos(p[0]);
  }};
  for (int i = 0; i < 3; ++i)
    for (const double sign : {1.0, -1.0})
      m.walls.push_back(HalfSpaceOf(sign * Vector3d::Unit(i), 1));
  return m;
}

inline Domain Ball() {
  Domain m = Make(3, 3, 1.3, 1, 1);
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 3)};
  return m;
}

inline Domain Shell() {
  Domain m = Make(3, 3, 1.3, 2, 2);
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 3), BallOf(Vector3d(0.05, 0, 0), 0.5, 1, 3)};
  return m;
}

inline Domain Cube() {
  Domain m = Make(3, 3, 1.3, 1, 1);
  for (int i = 0; i < 3; ++i)
    for (const double sign : {1.0, -1.0})
      m.walls.push_back(HalfSpaceOf(sign * Vector3d::Unit(i), 1));
  return m;
}

inline Domain SolidTorus() {
  Domain m = Make(3, 3, 1.6, 0, 1);
  m.walls = {TorusOf(-1)};
  return m;
}

inline Domain Cylinder() {
  Domain m = Make(3, 3, 1.3, 1, 1);
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 2), HalfSpaceOf(Vector3d::UnitZ(), 1),
             HalfSpaceOf(-Vector3d::UnitZ(), 1)};
  return m;
}

inline Domain HalfSphere3() {
  Domain m = Make(3, 4, 1.3, 1, 1);
  m.equations = {BallOf(Eigen::Vector4d::Zero(), 1, 1, 4)};
  m.walls = {HalfSpaceOf(Eigen::Vector4d(0.1, 0.3, 1, 0.2), 0.1)};
  return m;
}

}  // namespace stellate::testing
