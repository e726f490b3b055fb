#pragma once

#include <cmath>
#include <numbers>

#include "tests/core/support/domain.h"

namespace stellate::testing {

// Manifolds with boundary whose topology is known. Walls meet at 90 degrees, if at all, but in
// wedges and lunes.

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

inline Domain Make(int k, int d, double half, std::vector<int> homology,
                   std::vector<int> boundary_homology) {
  Domain m;
  m.k = k;
  m.d = d;
  m.box = CubeOf(d, half);
  m.homology = std::move(homology);
  m.boundary_homology = std::move(boundary_homology);
  return m;
}

inline Domain Arc() {
  Domain m = Make(1, 2, 1.3, {1, 0}, {2});
  m.equations = {BallOf(Vector2d::Zero(), 1, 1, 2)};
  m.walls = {HalfSpaceOf(Vector2d(1, 0.3), 0.4)};
  return m;
}

inline Domain Hemisphere() {
  Domain m = Make(2, 3, 1.3, {1, 0, 0}, {1, 1});
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  m.walls = {HalfSpaceOf(Vector3d(0.2, 0.3, 1), 0.1)};
  return m;
}

inline Domain HalfTorus() {
  Domain m = Make(2, 3, 1.6, {1, 1, 0}, {2, 2});
  m.equations = {TorusOf()};
  m.walls = {HalfSpaceOf(Vector3d(1, 0.1, 0.2), 0.05)};
  return m;
}

inline Domain Octant() {
  Domain m = Make(2, 3, 1.3, {1, 0, 0}, {1, 1});
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  for (int i = 0; i < 3; ++i) m.walls.push_back(HalfSpaceOf(Vector3d::Unit(i), 0));
  return m;
}

inline Domain Disc() {
  Domain m = Make(2, 2, 1.3, {1, 0, 0}, {1, 1});
  m.walls = {BallOf(Vector2d::Zero(), 1, -1, 2)};
  return m;
}

inline Domain Annulus() {
  Domain m = Make(2, 2, 1.3, {1, 1, 0}, {2, 2});
  m.walls = {BallOf(Vector2d::Zero(), 1, -1, 2), BallOf(Vector2d(0.1, 0), 0.4, 1, 2)};
  return m;
}

// The product of unit circles in R^2n.
inline std::vector<Domain::Function> CirclesOf(int n) {
  std::vector<Domain::Function> equations;
  for (int i = 0; i < n; ++i)
    equations.push_back([i](const VectorXd& p, VectorXd* g) {
      if (g) {
        g->setZero(p.size());
        g->segment(2 * i, 2) = 2 * p.segment(2 * i, 2);
      }
      return p.segment(2 * i, 2).squaredNorm() - 1;
    });
  return equations;
}

inline Domain HalfClifford() {
  Domain m = Make(2, 4, 1.3, {1, 1, 0}, {2, 2});
  m.equations = CirclesOf(2);
  m.walls = {HalfSpaceOf((VectorXd(4) << 1, 0.2, 0, 0).finished(), 0.1)};
  return m;
}

// sin x cos y + sin y cos z + sin z cos x.
inline double Gyroid(const VectorXd& p, VectorXd* g) {
  using std::cos, std::sin;
  if (g)
    *g = Vector3d(cos(p[0]) * cos(p[1]) - sin(p[2]) * sin(p[0]),
                  cos(p[1]) * cos(p[2]) - sin(p[0]) * sin(p[1]),
                  cos(p[2]) * cos(p[0]) - sin(p[1]) * sin(p[2]));
  return sin(p[0]) * cos(p[1]) + sin(p[1]) * cos(p[2]) + sin(p[2]) * cos(p[0]);
}

// |x_i| <= half.
inline void Box(Domain& m, double half) {
  for (int i = 0; i < m.d; ++i)
    for (const double sign : {1.0, -1.0})
      m.walls.push_back(HalfSpaceOf(sign * VectorXd::Unit(m.d, i), half));
}

// One lump of it, in a box of about a third of a period.
inline Domain GyroidInABox() {
  Domain m = Make(2, 3, 1.3, {1, 0, 0}, {1, 1});
  m.equations = {Gyroid};
  Box(m, 1);
  return m;
}

inline Domain Ball() {
  Domain m = Make(3, 3, 1.3, {1, 0, 0, 0}, {1, 0, 1});
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 3)};
  return m;
}

inline Domain Shell() {
  Domain m = Make(3, 3, 1.3, {1, 0, 1, 0}, {2, 0, 2});
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 3), BallOf(Vector3d(0.05, 0, 0), 0.5, 1, 3)};
  return m;
}

inline Domain Cube() {
  Domain m = Make(3, 3, 1.3, {1, 0, 0, 0}, {1, 0, 1});
  Box(m, 1);
  return m;
}

inline Domain SolidTorus() {
  Domain m = Make(3, 3, 1.6, {1, 1, 0, 0}, {1, 2, 1});
  m.walls = {TorusOf(-1)};
  return m;
}

inline Domain Cylinder() {
  Domain m = Make(3, 3, 1.3, {1, 0, 0, 0}, {1, 0, 1});
  m.walls = {BallOf(Vector3d::Zero(), 1, -1, 2), HalfSpaceOf(Vector3d::UnitZ(), 1),
             HalfSpaceOf(-Vector3d::UnitZ(), 1)};
  return m;
}

inline Domain HalfSphere3() {
  Domain m = Make(3, 4, 1.3, {1, 0, 0, 0}, {1, 0, 1});
  m.equations = {BallOf(Eigen::Vector4d::Zero(), 1, 1, 4)};
  m.walls = {HalfSpaceOf(Eigen::Vector4d(0.1, 0.3, 1, 0.2), 0.1)};
  return m;
}

// Moebius strips: the half-plane turns by half a turn on the way round.
inline Domain Moebius3() {
  Domain m = Make(2, 3, 1.6, {1, 1, 0}, {1, 1});
  m.equations = {[](const VectorXd& p, VectorXd* g) {
    const double q = std::hypot(p[0], p[1]), u = std::atan2(p[1], p[0]) / 2;
    const double s = std::sin(u), c = std::cos(u);
    if (g) {
      const double along = 0.5 * ((q - 1) * c + p[2] * s) / (q * q);
      *g = Vector3d(s * p[0] / q - along * p[1], s * p[1] / q + along * p[0], -c);
    }
    return (q - 1) * s - p[2] * c;
  }};
  m.walls = {[](const VectorXd& p, VectorXd* g) {
    const double q = std::hypot(p[0], p[1]), away = q - 1;
    if (g) *g = -2 * Vector3d(away * p[0] / q, away * p[1] / q, p[2]);
    return 0.16 - away * away - p[2] * p[2];
  }};
  return m;
}

inline Domain Moebius4() {
  Domain m = Make(2, 4, 1.3, {1, 1, 0}, {1, 1});
  m.equations = {CirclesOf(1)[0], [](const VectorXd& p, VectorXd* g) {
                   const double q2 = p.head(2).squaredNorm(), u = std::atan2(p[1], p[0]) / 2;
                   const double s = std::sin(u), c = std::cos(u);
                   if (g) {
                     const double along = 0.5 * (p[2] * c + p[3] * s) / q2;
                     *g = Eigen::Vector4d(-along * p[1], along * p[0], s, -c);
                   }
                   return p[2] * s - p[3] * c;
                 }};
  m.walls = {[](const VectorXd& p, VectorXd* g) {
    if (g) *g = Eigen::Vector4d(0, 0, -2 * p[2], -2 * p[3]);
    return 0.25 - p.tail(2).squaredNorm();
  }};
  return m;
}

// A graph over the unit disc of R^2.
inline Domain BentDisc() {
  Domain m = Make(2, 4, 1.3, {1, 0, 0}, {1, 1});
  m.equations = {[](const VectorXd& p, VectorXd* g) {
                   if (g) *g = Eigen::Vector4d(-0.8 * p[0], 0.8 * p[1], 1, 0);
                   return p[2] - 0.4 * (p[0] * p[0] - p[1] * p[1]);
                 },
                 [](const VectorXd& p, VectorXd* g) {
                   if (g) *g = Eigen::Vector4d(-0.4 * p[1], -0.4 * p[0], 0, 1);
                   return p[3] - 0.4 * p[0] * p[1];
                 }};
  m.walls = {BallOf(Eigen::Vector4d::Zero(), 1, -1, 2)};
  return m;
}

// A cylinder through it takes two discs away.
inline Domain DrilledTorus() {
  Domain m = Make(2, 3, 1.6, {1, 3, 0}, {2, 2});
  m.equations = {TorusOf()};
  m.walls = {BallOf(Vector3d(1, 0, 0), 0.25, 1, 2)};
  return m;
}

inline Domain BoxMinusBall() {
  Domain m = Make(3, 3, 1.3, {1, 0, 1, 0}, {2, 0, 2});
  Box(m, 1);
  m.walls.push_back(BallOf(Vector3d::Zero(), 0.5, 1, 3));
  return m;
}

inline Domain DrilledBox() {
  Domain m = Make(3, 3, 1.3, {1, 1, 0, 0}, {1, 2, 1});
  Box(m, 1);
  m.walls.push_back(BallOf(Vector3d::Zero(), 0.5, 1, 2));
  return m;
}

// The gyroid's one side in a box: of half a width of 1 the edges are as sharp as 37 degrees, of 2.5
// as 27.
inline Domain GyroidSolid(double half) {
  Domain m = half < 2 ? Make(3, 3, 1.1 * half, {1, 0, 0, 0}, {1, 0, 1})
                      : Make(3, 3, 1.1 * half, {1, 2, 0, 0}, {1, 4, 1});
  m.walls = {Gyroid};
  Box(m, half);
  return m;
}
inline Domain SmallGyroidSolid() { return GyroidSolid(1); }
inline Domain LargeGyroidSolid() { return GyroidSolid(2.5); }

// The gyroid's one side in a cell of one period.
inline Domain GyroidCell(const Vector3d& low) {
  constexpr double kPeriod = 2 * std::numbers::pi;
  Domain m = Make(3, 3, 1, {}, {});
  m.box = {low.array() - 0.05, low.array() + kPeriod + 0.05};
  m.walls = {Gyroid};
  for (int i = 0; i < 3; ++i) {
    m.walls.push_back(HalfSpaceOf(Vector3d::Unit(i), -low[i]));
    m.walls.push_back(HalfSpaceOf(-Vector3d::Unit(i), low[i] + kPeriod));
  }
  return m;
}

// The sheets |G| <= t: walls meet at 18 to 21 degrees where t is 0.8.
inline Domain GyroidSheets(double t) {
  Domain m = GyroidCell(Vector3d::Constant(0.13));
  m.walls[0] = [t](const VectorXd& p, VectorXd* g) { return Gyroid(p, g) + t; };
  m.walls.push_back([t](const VectorXd& p, VectorXd* g) {
    const double value = t - Gyroid(p, g);
    if (g) *g = -*g;
    return value;
  });
  return m;
}

// What two unit balls have in common: its edge is a circle, of sin (degrees / 2) as radius.
inline Domain Lens(double degrees) {
  const double half = degrees * std::numbers::pi / 360;
  const Vector3d up = std::cos(half) * Vector3d::UnitZ();
  Domain m = Make(3, 3, 1.1 * std::sin(half), {1, 0, 0, 0}, {1, 0, 1});
  m.walls = {BallOf(up, 1, -1, 3), BallOf(-up, 1, -1, 3)};
  return m;
}

// Four walls meet in each corner.
inline Domain Octahedron() {
  Domain m = Make(3, 3, 1.1, {1, 0, 0, 0}, {1, 0, 1});
  for (int i = 0; i < 8; ++i)
    m.walls.push_back(HalfSpaceOf(Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1), 1));
  return m;
}

// ... in its top. With its ground, which leans, they meet at 37 degrees and more.
inline Domain Pyramid() {
  Domain m = Make(3, 3, 1.9, {1, 0, 0, 0}, {1, 0, 1});
  for (int i = 0; i < 2; ++i)
    for (const double sign : {1.0, -1.0})
      m.walls.push_back(
          HalfSpaceOf((sign * Vector3d::Unit(i) - 1.1 * Vector3d::UnitZ()).normalized(), 0.7));
  m.walls.push_back(HalfSpaceOf(Vector3d(0.1, 0, 1).normalized(), 0.5));
  return m;
}

// An interval times a torus.
inline Domain CutTorus3() {
  Domain m = Make(3, 6, 1.2, {1, 2, 1, 0}, {2, 4, 2});
  m.equations = CirclesOf(3);
  m.walls = {HalfSpaceOf(VectorXd::Unit(6, 0) + 0.5 * VectorXd::Unit(6, 2), -0.1)};
  return m;
}

// A square times a circle.
inline Domain TwiceCutTorus3() {
  Domain m = Make(3, 6, 1.2, {1, 1, 0, 0}, {1, 2, 1});
  m.equations = CirclesOf(3);
  m.walls = {HalfSpaceOf(VectorXd::Unit(6, 0), -0.1), HalfSpaceOf(VectorXd::Unit(6, 2), -0.1)};
  return m;
}

// Orthogonal matrices that turn the first axis by less than 60 degrees: two solid tori.
inline Domain JointLimits() {
  Domain m = Make(3, 9, 1.2, {2, 2, 0, 0}, {2, 4, 2});
  for (int a = 0; a < 3; ++a)
    for (int b = a; b < 3; ++b)
      m.equations.push_back([a, b](const VectorXd& p, VectorXd* g) {
        if (g) {
          g->setZero(9);
          g->segment(3 * a, 3) += p.segment(3 * b, 3);
          g->segment(3 * b, 3) += p.segment(3 * a, 3);
        }
        return p.segment(3 * a, 3).dot(p.segment(3 * b, 3)) - (a == b ? 1 : 0);
      });
  m.walls = {HalfSpaceOf(VectorXd::Unit(9, 0), -0.5)};
  return m;
}

inline Domain Ball4() {
  Domain m = Make(4, 4, 1.2, {1, 0, 0, 0, 0}, {1, 0, 0, 1});
  m.walls = {BallOf(Eigen::Vector4d::Zero(), 1, -1, 4)};
  return m;
}

inline Domain HalfSphere4() {
  Domain m = Make(4, 5, 1.2, {1, 0, 0, 0, 0}, {1, 0, 0, 1});
  m.equations = {BallOf(VectorXd::Zero(5), 1, 1, 5)};
  m.walls = {HalfSpaceOf(VectorXd::Unit(5, 0), 0)};
  return m;
}

// An interval times a 3-torus.
inline Domain CutTorus4() {
  Domain m = Make(4, 8, 1.2, {1, 3, 3, 1, 0}, {2, 6, 6, 2});
  m.equations = CirclesOf(4);
  m.walls = {HalfSpaceOf(VectorXd::Unit(8, 0), 0)};
  return m;
}

// The cube of R^d by a single function: its wall has creases.
inline Domain CreasedCube(int d) {
  Domain m = Make(d, d, 1.3, {}, {});
  m.walls = {[](const VectorXd& x, VectorXd* g) {
    Eigen::Index i = 0;
    const double most = x.cwiseAbs().maxCoeff(&i);
    if (g) *g = (x[i] > 0 ? -1 : 1) * VectorXd::Unit(x.size(), i);
    return 1 - most;
  }};
  return m;
}

// The unit disc without a smaller one.
inline Domain PiercedDisc(double radius) {
  Domain m = Make(2, 2, 1.3, {1, 1, 0}, {2, 2});
  m.walls = {BallOf(Vector2d::Zero(), 1, -1, 2), BallOf(Vector2d(0.1, 0.05), radius, 1, 2)};
  return m;
}

// Two half-spaces through the last axes whose borders meet at an angle.
inline std::vector<Domain::Function> WedgeOf(double degrees, int d) {
  const double t = degrees * std::numbers::pi / 180;
  VectorXd first = VectorXd::Unit(d, 1);
  VectorXd second = std::sin(t) * VectorXd::Unit(d, 0) - std::cos(t) * VectorXd::Unit(d, 1);
  return {HalfSpaceOf(first, 0), HalfSpaceOf(second, 0)};
}

// Of the unit ball.
inline Domain Wedge(double degrees) {
  Domain m = Make(3, 3, 1.3, {1, 0, 0, 0}, {1, 0, 1});
  m.walls = WedgeOf(degrees, 3);
  m.walls.push_back(BallOf(Vector3d::Zero(), 1, -1, 3));
  return m;
}

inline Domain Wedge40() { return Wedge(40); }
inline Domain Wedge20() { return Wedge(20); }

// Of the unit sphere.
inline Domain Lune(double degrees) {
  Domain m = Make(2, 3, 1.3, {1, 0, 0}, {1, 1});
  m.equations = {BallOf(Vector3d::Zero(), 1, 1, 3)};
  m.walls = WedgeOf(degrees, 3);
  return m;
}

}  // namespace stellate::testing
