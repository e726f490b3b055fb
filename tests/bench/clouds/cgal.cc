#include <CGAL/Advancing_front_surface_reconstruction.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polyhedron_3.h>
#include <CGAL/compute_average_spacing.h>
#include <CGAL/jet_estimate_normals.h>
#include <CGAL/mst_orient_normals.h>
#include <CGAL/poisson_surface_reconstruction.h>
#include <CGAL/property_map.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>

#include "tests/bench/clouds/reconstruct.h"
#include "tests/bench/peers/meter.h"

namespace stellate::bench {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using PointAndNormal = std::pair<Point, Kernel::Vector_3>;
using Polyhedron = CGAL::Polyhedron_3<Kernel>;

constexpr int kNeighbours = 18;  // CGAL's own example has as many, for normals
constexpr int kSpacingNeighbours = 6;

bool IsSurfaceInSpace(const testing::Sample& sample) { return sample.k == 2 && sample.d == 3; }

Reconstructed DoesNotApply() {
  Reconstructed none;
  none.applies = false;
  return none;
}

void Add(std::array<std::uint32_t, 3> triangle, Reconstructed* made) {
  std::sort(triangle.begin(), triangle.end());
  made->simplices.insert(made->simplices.end(), triangle.begin(), triangle.end());
}

}  // namespace

Reconstructed ReconstructWithFront(const testing::Sample& sample) {
  if (!IsSurfaceInSpace(sample)) return DoesNotApply();
  std::vector<Point> points;
  for (const auto& x : sample.points.colwise()) points.emplace_back(x[0], x[1], x[2]);
  std::vector<std::array<std::size_t, 3>> triangles;
  Reconstructed made;
  const double before = ProcessorSeconds();
  CGAL::advancing_front_surface_reconstruction(points.begin(), points.end(),
                                               std::back_inserter(triangles));
  made.seconds = ProcessorSeconds() - before;
  made.vertices = static_cast<std::uint32_t>(points.size());
  for (const auto& t : triangles)
    Add({static_cast<std::uint32_t>(t[0]), static_cast<std::uint32_t>(t[1]),
         static_cast<std::uint32_t>(t[2])},
        &made);
  return made;
}

Reconstructed ReconstructWithPoisson(const testing::Sample& sample) {
  if (!IsSurfaceInSpace(sample)) return DoesNotApply();
  std::vector<PointAndNormal> points;
  for (const auto& x : sample.points.colwise())
    points.emplace_back(Point(x[0], x[1], x[2]), CGAL::NULL_VECTOR);
  const auto maps = CGAL::parameters::point_map(CGAL::First_of_pair_property_map<PointAndNormal>())
                        .normal_map(CGAL::Second_of_pair_property_map<PointAndNormal>());
  Reconstructed made;
  Polyhedron surface;
  const double before = ProcessorSeconds();
  CGAL::jet_estimate_normals<CGAL::Sequential_tag>(points, kNeighbours, maps);
  points.erase(CGAL::mst_orient_normals(points, kNeighbours, maps), points.end());
  const double spacing = CGAL::compute_average_spacing<CGAL::Sequential_tag>(
      points, kSpacingNeighbours,
      CGAL::parameters::point_map(CGAL::First_of_pair_property_map<PointAndNormal>()));
  const bool done = CGAL::poisson_surface_reconstruction_delaunay(
      points.begin(), points.end(), CGAL::First_of_pair_property_map<PointAndNormal>(),
      CGAL::Second_of_pair_property_map<PointAndNormal>(), surface, spacing);
  made.seconds = ProcessorSeconds() - before;
  if (!done) return made;
  std::map<Polyhedron::Vertex_const_handle, std::uint32_t> ids;
  for (auto v = surface.vertices_begin(); v != surface.vertices_end(); ++v)
    ids.emplace(v, made.vertices++);
  for (auto f = surface.facets_begin(); f != surface.facets_end(); ++f) {
    const auto edge = f->facet_begin();
    Add({ids.at(edge->vertex()), ids.at(edge->next()->vertex()),
         ids.at(edge->next()->next()->vertex())},
        &made);
  }
  return made;
}

}  // namespace stellate::bench
