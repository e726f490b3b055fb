// Solids, beside CGAL's mesher of volumes with features: prints a table, asserts nothing.
//
//   solids [SCALE [REGEX]]     SCALE: of all epsilons (1); REGEX: of lines, as "solid torus, CGAL"
//
// CGAL is given the labels as a function, and the curves where walls meet, at a quarter of the
// mesh's edges, but for one line, which is not; Stellate finds them. With "by labels" Stellate is
// given a table of labels where walls alone would do: what that costs. Seconds are of the
// processor, one thread, oracle and certificate included.
//   least, most       dihedral angles of the cells, degrees
//   of 1000           cells by their least dihedral angles: below 5 degrees, 10, 15 ... 60, and
//   corners, middles  how far the vertices and barycentres of the boundary's triangles, and of
//   those
//                     between regions, are from the nearest wall
//   edges, kept       where these triangles meet at more than 30 degrees, or more than two do: how
//   far
//                     vertices are from where walls meet, and the length beside that of Stellate's
//   chi               Euler characteristics of the regions

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <map>
#include <numbers>
#include <regex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/solids/solid.h"
#include "tests/core/support/arrangements.h"
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

using testing::Arrangement;

Solid Of(const Arrangement& a, const char* name, double epsilon) {
  Solid solid{name, a.domain, epsilon, a.label};
  solid.domain.k = solid.domain.d = 3;
  return solid;
}

// Of arrangements that tests have, that of a name.
Solid Named(const std::vector<Arrangement>& all, const std::string& of, const char* name,
            double epsilon) {
  for (const Arrangement& a : all)
    if (a.name == of) return Of(a, name, epsilon);
  throw std::logic_error("no arrangement " + of);
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

using Triangle = std::array<Id, 3>;

// Triangles where the labels on both sides differ, with the label and the opposite corner of a
// cell.
std::map<Triangle, int> Interfaces(const SolidMesh& mesh) {
  std::map<Triangle, std::pair<int, int>> sides;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c)
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& cell = mesh.cells[c];
      Triangle t{cell[(i + 1) % 4], cell[(i + 2) % 4], cell[(i + 3) % 4]};
      std::sort(t.begin(), t.end());
      const auto [entry, is_new] = sides.emplace(t, std::pair(mesh.labels[c], 0));
      if (!is_new) entry->second.second = mesh.labels[c];
    }
  std::map<Triangle, int> interfaces;
  for (const auto& [t, pair] : sides)
    if (pair.first != pair.second)
      interfaces[t] = 256 * std::max(pair.first, pair.second) + std::min(pair.first, pair.second);
  return interfaces;
}

// How far x is from the nearest wall, or, with `two`, from the nearest place where two walls meet:
// by their values and slopes.
double DistanceFrom(const Domain& domain, const Vector3d& x, bool two) {
  std::vector<double> values;
  std::vector<Vector3d> slopes;
  for (const auto& wall : domain.walls) {
    Eigen::VectorXd gradient(3);
    const double value = wall(x, &gradient);
    values.push_back(value / gradient.norm());
    slopes.emplace_back(gradient.normalized());
  }
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!two) nearest = std::min(nearest, std::abs(values[i]));
    for (std::size_t j = 0; two && j < i; ++j) {
      const double c = slopes[i].dot(slopes[j]), a = values[i], b = values[j];
      if (std::abs(c) > 0.99) continue;
      nearest = std::min(nearest, std::sqrt((a * a + b * b - 2 * a * b * c) / (1 - c * c)));
    }
  }
  return nearest;
}

struct Errors {
  double corners = 0, middles = 0;
  double edges = 0;   // of vertices where triangles meet at an angle
  double length = 0;  // of these edges
};

Errors ErrorsOf(const SolidMesh& mesh, const Domain& domain) {
  constexpr double kSharp = 0.866;  // 30 degrees
  Errors errors;
  std::map<std::pair<Id, Id>, std::vector<std::pair<Vector3d, int>>> around;
  for (const auto& [t, labels] : Interfaces(mesh)) {
    const Vector3d &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
    for (const Vector3d& x : {a, b, c})
      errors.corners = std::max(errors.corners, DistanceFrom(domain, x, false));
    errors.middles = std::max(errors.middles, DistanceFrom(domain, (a + b + c) / 3, false));
    const Vector3d normal = (b - a).cross(c - a).normalized();
    for (const auto& [i, j] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)})
      around[{t[static_cast<std::size_t>(i)], t[static_cast<std::size_t>(j)]}].emplace_back(normal,
                                                                                            labels);
  }
  for (const auto& [edge, triangles] : around) {
    const bool is_flat =
        triangles.size() == 2 && std::abs(triangles[0].first.dot(triangles[1].first)) > kSharp;
    if (is_flat) continue;
    errors.length += (mesh.points[edge.first] - mesh.points[edge.second]).norm();
    for (const Id v : {edge.first, edge.second})
      errors.edges = std::max(errors.edges, DistanceFrom(domain, mesh.points[v], true));
  }
  return errors;
}

// Euler characteristics of the regions.
std::string EulerOf(const SolidMesh& mesh) {
  std::map<int, std::array<std::set<std::vector<Id>>, 4>> faces;
  for (std::size_t c = 0; c < mesh.cells.size(); ++c)
    for (unsigned subset = 1; subset < 16; ++subset) {
      std::vector<Id> face;
      for (unsigned i = 0; i < 4; ++i)
        if ((subset >> i & 1) != 0) face.push_back(mesh.cells[c][i]);
      std::sort(face.begin(), face.end());
      faces[mesh.labels[c]][face.size() - 1].insert(std::move(face));
    }
  std::string said;
  for (const auto& [label, by] : faces) {
    const auto size = [&by](std::size_t i) { return static_cast<long>(by[i].size()); };
    said += (said.empty() ? "" : " ") + std::to_string(size(0) - size(1) + size(2) - size(3));
  }
  return said;
}

// `length`: of Stellate's edges; 0 makes it this mesh's.
void Print(const Solid& solid, const char* mesher, double epsilon, const SolidMesh& mesh,
           double* length) {
  double least = 180, largest = 0;
  std::array<std::size_t, kBins> bins{};
  for (const auto& [low, high] : DihedralAngles(mesh)) {
    least = std::min(least, low);
    largest = std::max(largest, high);
    ++bins[std::min(static_cast<std::size_t>(low / kBin), kBins - 1)];
  }
  const Errors errors = ErrorsOf(mesh, solid.domain);
  if (*length == 0) *length = errors.length;
  const auto n = static_cast<double>(mesh.points.size());
  std::printf(
      "%-26s %-8s %7.3f %8zu %8zu %8.3f %8.3f %9.0f %6.1f %6.1f %9.1e %9.1e %9.1e %5.2f  chi %s, "
      "%s\n",
      solid.name.c_str(), mesher, epsilon, mesh.points.size(), mesh.cells.size(), mesh.seconds,
      mesh.oracle_seconds, n / mesh.seconds, least, largest, errors.corners, errors.middles,
      errors.edges, *length > 0 ? errors.length / *length : 1, EulerOf(mesh).c_str(),
      mesh.note.c_str());
  std::printf("%26s %-8s %7s", "", "of 1000", "");
  for (const std::size_t bin : bins)
    std::printf(" %5.1f", 1000 * static_cast<double>(bin) / static_cast<double>(mesh.cells.size()));
  std::printf("\n");
  std::fflush(stdout);
}

std::vector<Solid> Solids() {
  const auto all_of = [](int walls) {
    return [walls](core::WallSet s) { return testing::AllOf(s, 0, walls) ? 1 : 0; };
  };
  const Domain box = InBox(1, BallOf(Vector3d::Zero(), 0.6, 1, 3)), gyroid = InBox(2, Gyroid);
  const std::vector<Arrangement> space = testing::SpaceArrangements();
  const std::vector<Arrangement> phases = testing::PhaseArrangements();
  const Arrangement lens =
      testing::OfBalls(3, "Lens", [](core::WallSet s) { return s == 3 ? 1 : 0; }, {});
  Solid sharp = Of(lens, "lens of 40 degrees", 0.06);
  for (const int side : {0, 1})
    sharp.domain.walls[static_cast<std::size_t>(side)] = testing::InBall(
        (side == 0 ? 1 : -1) * std::cos(std::numbers::pi / 9) * Vector3d::Unit(0), 1);
  sharp.label = nullptr;  // both are positive inside
  return {
      {"box minus ball", box, 0.12, nullptr},
      {"box minus ball, by labels", box, 0.12, all_of(7)},
      {"gyroid solid", gyroid, 0.2, nullptr},
      {"gyroid solid, by labels", gyroid, 0.2, all_of(7)},
      {"solid torus", SolidTorus(), 0.08, nullptr},
      {"solid torus, by labels", SolidTorus(), 0.08, all_of(1)},
      Named(space, "Union", "two balls joined", 0.13),
      Named(space, "BallInCube", "cube with a ball in it", 0.12),
      Named(space, "CubePlusBall", "cube and ball joined", 0.14),
      Named(phases, "ThreePhasesInDimension3", "three phases in a ball", 0.1),
      sharp,
  };
}

int Main(int argc, char** argv) {
  const double scale = argc > 1 ? std::atof(argv[1]) : 1;
  const std::regex chosen(argc > 2 ? argv[2] : "");
  if (!(scale > 0)) throw std::invalid_argument("usage: solids [SCALE [REGEX]]");
  for (const Solid& solid : Solids()) {
    const auto is_chosen = [&](const char* mesher) {
      return std::regex_search(solid.name + ", " + mesher, chosen);
    };
    if (!is_chosen("Stellate") && !is_chosen("CGAL")) continue;
    const double epsilon = scale * solid.epsilon;
    std::vector<Curve> edges;
    double length = 0;
    std::fprintf(stderr, "%s, Stellate ...\n", solid.name.c_str());
    Print(solid, "Stellate", epsilon, MeshWithStellate(solid, epsilon, &edges), &length);
    if (!is_chosen("CGAL") || solid.name.ends_with("by labels")) continue;
    std::fprintf(stderr, "%s, CGAL ...\n", solid.name.c_str());
    for (const bool optimized : {false, true})
      Print(solid, "CGAL", epsilon, MeshWithCgal(solid, epsilon, edges, optimized), &length);
    if (!edges.empty())
      Print(solid, "CGAL", epsilon, MeshWithCgal(solid, epsilon, {}, true), &length);
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
