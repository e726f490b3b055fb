#include <CGAL/Complex_2_in_triangulation_3.h>
#include <CGAL/Implicit_surface_3.h>
#include <CGAL/Surface_mesh_default_triangulation_3.h>
#include <CGAL/make_surface_mesh.h>

#include <cmath>
#include <map>
#include <stdexcept>

#include "tests/bench/peers/peer.h"

namespace stellate::bench {
namespace {

using Triangulation = CGAL::Surface_mesh_default_triangulation_3;
using Complex = CGAL::Complex_2_in_triangulation_3<Triangulation>;
using Traits = Triangulation::Geom_traits;
using Point = Traits::Point_3;
using Function = double (*)(Point);

std::uint64_t evaluations = 0;

double Sphere(Point p) {
  ++evaluations;
  return p.x() * p.x() + p.y() * p.y() + p.z() * p.z() - 1;
}
// Tube of radius 0.4 about the unit circle, squared to be free of roots.
double Torus(Point p) {
  ++evaluations;
  const double rho2 = p.x() * p.x() + p.y() * p.y();
  const double level = rho2 + p.z() * p.z() + 1 - 0.4 * 0.4;
  return level * level - 4 * rho2;
}
double Tanglecube(Point p) {
  ++evaluations;
  const double x2 = p.x() * p.x(), y2 = p.y() * p.y(), z2 = p.z() * p.z();
  return x2 * (x2 - 5) + y2 * (y2 - 5) + z2 * (z2 - 5) + 11.8;
}

struct Surface {
  const char* manifold;
  Function function;
  Point inside;   // where the function is negative
  double radius;  // of a ball about it that holds the surface
};
const Surface kSurfaces[] = {
    {"sphere:2", Sphere, {0, 0, 0}, 1.5},
    {"torus:1:0.4", Torus, {1, 0, 0}, 2.6},
    {"tanglecube", Tanglecube, {1.5, 1.5, 1.5}, 7},
};

}  // namespace

Outcome MeshWithCgalSurface(const Task& task, Meter& meter) {
  const Surface* known = nullptr;
  for (const Surface& surface : kSurfaces) {
    if (task.manifold == surface.manifold) known = &surface;
  }
  if (known == nullptr) throw std::runtime_error("no implicit function for " + task.manifold);
  // How well a point is put on the surface, as a share of the ball's radius. The default, 1e-3,
  // would drown a fine mesh's own error; this keeps it well below, and costs a few evaluations.
  const double precision = 0.05 * task.size * task.size / known->radius;

  Outcome outcome;
  evaluations = 0;
  meter.Start();
  Triangulation triangulation;
  Complex complex(triangulation);
  const CGAL::Implicit_surface_3<Traits, Function> surface(
      known->function, Traits::Sphere_3(known->inside, known->radius * known->radius), precision);
  // The radius alone bounds the size, as epsilon does: the bound on the distance is out of reach.
  const CGAL::Surface_mesh_default_criteria_3<Triangulation> criteria(30, task.size, known->radius);
  // Without its check for being a manifold it is a third faster; the harness has one of its own.
  CGAL::make_surface_mesh(complex, surface, criteria, CGAL::Non_manifold_tag());
  meter.Stop();

  outcome.evaluations = evaluations;
  std::map<Triangulation::Vertex_handle, std::uint32_t> ids;
  std::vector<Point> points;
  for (auto facet = complex.facets_begin(); facet != complex.facets_end(); ++facet) {
    for (int i = 1; i <= 3; ++i) {
      const auto vertex = facet->first->vertex((facet->second + i) % 4);
      const auto [entry, is_new] = ids.emplace(vertex, static_cast<std::uint32_t>(points.size()));
      if (is_new) points.push_back(vertex->point());
      outcome.simplices.push_back(entry->second);
    }
  }
  outcome.points.resize(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    outcome.points.col(static_cast<Eigen::Index>(i)) << points[i].x(), points[i].y(), points[i].z();
  }
  return outcome;
}

}  // namespace stellate::bench
