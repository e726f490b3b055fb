// Solids, beside CGAL's mesher of volumes with features: prints a table, asserts nothing.
//
//   solids [SCALE [REGEX]]     SCALE: of all epsilons (1); REGEX: of lines, as "solid torus, CGAL"
//
// CGAL is given the curves where walls meet, at a quarter of the mesh's edges; Stellate finds them.
// Seconds are of the processor, one thread, oracle and certificate included.
//   least, most       dihedral angles of the cells, degrees
//   of 1000           cells by their least dihedral angles: below 5 degrees, 10, 15 ... 60, and
//   above corners, middles  how far the boundary's vertices and barycentres are from it

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <map>
#include <regex>
#include <string>

#include "tests/bench/solids/solid.h"
#include "tests/core/support/dihedrals.h"

namespace stellate::bench {
namespace {

using Eigen::Vector3d;

// Of the histogram of least angles, degrees.
constexpr double kBin = 5;
constexpr std::size_t kBins = 13;

using testing::BallOf;
using testing::CubeOf;
using testing::Domain;
using testing::HalfSpaceOf;
using testing::TorusOf;

Domain InBox(double half, Domain::Function wall) {
  Domain m;
  m.k = m.d = 3;
  m.box = CubeOf(3, 1.3 * half);
  for (int i = 0; i < 3; ++i)
    for (const double sign : {1.0, -1.0})
      m.walls.push_back(HalfSpaceOf(sign * Vector3d::Unit(i), half));
  m.walls.push_back(std::move(wall));
  return m;
}

double Gyroid(const Eigen::VectorXd& p, Eigen::VectorXd* g) {
  using std::cos, std::sin;
  if (g)
    *g = Vector3d(cos(p[0]) * cos(p[1]) - sin(p[2]) * sin(p[0]),
                  cos(p[1]) * cos(p[2]) - sin(p[0]) * sin(p[1]),
                  cos(p[2]) * cos(p[0]) - sin(p[1]) * sin(p[2]));
  return sin(p[0]) * cos(p[1]) + sin(p[1]) * cos(p[2]) + sin(p[2]) * cos(p[0]);
}

Domain SolidTorus() {
  Domain m;
  m.k = m.d = 3;
  m.box = CubeOf(3, 1.6);
  m.walls = {TorusOf(-1)};
  return m;
}

// Degrees: the least and the largest dihedral angle of each cell.
std::vector<std::pair<double, double>> DihedralAngles(const SolidMesh& mesh) {
  std::vector<std::pair<double, double>> angles;
  for (const auto& cell : mesh.cells)
    angles.push_back(testing::DihedralAnglesOf(
        {mesh.points[cell[0]], mesh.points[cell[1]], mesh.points[cell[2]], mesh.points[cell[3]]}));
  return angles;
}

// The largest distance, by the walls' values over their slopes, of a point of the boundary's
// triangles (their corners and middles) from the boundary.
std::pair<double, double> BoundaryErrors(const SolidMesh& mesh, const Domain& domain) {
  std::map<std::array<Id, 3>, int> triangles;
  for (const auto& cell : mesh.cells)
    for (std::size_t i = 0; i < 4; ++i) {
      std::array<Id, 3> t{cell[(i + 1) % 4], cell[(i + 2) % 4], cell[(i + 3) % 4]};
      std::sort(t.begin(), t.end());
      ++triangles[t];
    }
  const auto off = [&](const Vector3d& x) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& wall : domain.walls) {
      Eigen::VectorXd gradient(3);
      const double value = wall(x, &gradient);
      nearest = std::min(nearest, std::abs(value) / gradient.norm());
    }
    return nearest;
  };
  double corners = 0, middles = 0;
  for (const auto& [t, count] : triangles) {
    if (count != 1) continue;
    const Vector3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
    for (const Vector3d& x : {a, b, c}) corners = std::max(corners, off(x));
    middles = std::max(middles, off((a + b + c) / 3));
  }
  return {corners, middles};
}

void Print(const Solid& solid, const char* mesher, double epsilon, const SolidMesh& mesh) {
  double least = 180, largest = 0;
  std::array<std::size_t, kBins> bins{};
  for (const auto& [low, high] : DihedralAngles(mesh)) {
    least = std::min(least, low);
    largest = std::max(largest, high);
    ++bins[std::min(static_cast<std::size_t>(low / kBin), kBins - 1)];
  }
  const auto [corners, middles] = BoundaryErrors(mesh, solid.domain);
  const auto n = static_cast<double>(mesh.points.size());
  std::printf("%-16s %-8s %7.3f %8zu %8zu %8.3f %8.3f %9.0f %6.1f %6.1f %9.1e %9.1e  %s\n",
              solid.name, mesher, epsilon, mesh.points.size(), mesh.cells.size(), mesh.seconds,
              mesh.oracle_seconds, n / mesh.seconds, least, largest, corners, middles,
              mesh.note.c_str());
  std::printf("%16s %-8s %7s", "", "of 1000", "");
  for (const std::size_t bin : bins)
    std::printf(" %5.1f", 1000 * static_cast<double>(bin) / static_cast<double>(mesh.cells.size()));
  std::printf("\n");
  std::fflush(stdout);
}

int Main(int argc, char** argv) {
  const double scale = argc > 1 ? std::atof(argv[1]) : 1;
  const std::regex chosen(argc > 2 ? argv[2] : "");
  if (!(scale > 0)) throw std::invalid_argument("usage: solids [SCALE [REGEX]]");
  const Solid solids[] = {
      {"box minus ball", InBox(1, BallOf(Vector3d::Zero(), 0.6, 1, 3)), 0.12},
      {"gyroid solid", InBox(2, Gyroid), 0.2},
      {"solid torus", SolidTorus(), 0.08},
  };
  std::printf("%-16s %-8s %7s %8s %8s %8s %8s %9s %6s %6s %9s %9s\n", "solid", "mesher", "epsilon",
              "vertices", "cells", "CPU s", "oracle s", "vert./s", "least", "most", "corners",
              "middles");
  for (const Solid& solid : solids) {
    const auto is_chosen = [&](const char* mesher) {
      return std::regex_search(std::string(solid.name) + ", " + mesher, chosen);
    };
    if (!is_chosen("Stellate") && !is_chosen("CGAL")) continue;
    const double epsilon = scale * solid.epsilon;
    std::vector<Curve> edges;
    std::fprintf(stderr, "%s, Stellate ...\n", solid.name);
    Print(solid, "Stellate", epsilon, MeshWithStellate(solid, epsilon, &edges));
    for (const bool optimized : {false, true}) {
      if (!is_chosen("CGAL")) break;
      std::fprintf(stderr, "%s, CGAL%s ...\n", solid.name, optimized ? " optimized" : "");
      Print(solid, "CGAL", epsilon, MeshWithCgal(solid, epsilon, edges, optimized));
    }
  }
  return 0;
}

}  // namespace
}  // namespace stellate::bench

int main(int argc, char** argv) {
  try {
    return stellate::bench::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "solids: %s\n", error.what());
    return 1;
  }
}
