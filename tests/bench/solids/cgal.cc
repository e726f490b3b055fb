#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_domain_with_polyline_features_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>

#include <algorithm>
#include <functional>
#include <map>

#include "tests/bench/peers/meter.h"
#include "tests/bench/solids/solid.h"

namespace stellate::bench {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Domain = CGAL::Mesh_domain_with_polyline_features_3<CGAL::Labeled_mesh_domain_3<Kernel>>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index,
                                                        Domain::Curve_index>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;

}  // namespace

SolidMesh MeshWithCgal(const Solid& solid, double epsilon, const std::vector<Curve>& edges,
                       bool optimized) {
  const std::function<int(const Point&)> label = [&solid](const Point& p) {
    return solid.LabelAt({p.x(), p.y(), p.z()});
  };
  const Eigen::VectorXd centre = (solid.domain.box.lower + solid.domain.box.upper) / 2;
  const double radius = (solid.domain.box.upper - solid.domain.box.lower).norm() / 2;
  std::vector<std::vector<Point>> curves;
  for (const Curve& edge : edges) {
    curves.emplace_back();
    for (const Eigen::Vector3d& x : edge) curves.back().emplace_back(x[0], x[1], x[2]);
  }

  SolidMesh mesh;
  const double began = ProcessorSeconds();
  // The error of a boundary's points, as a share of the ball's radius: well below the mesh's own.
  Domain domain(label, Kernel::Sphere_3(Point(centre[0], centre[1], centre[2]), radius * radius),
                0.01 * epsilon * epsilon / radius);
  domain.add_features(curves.begin(), curves.end());
  const Criteria criteria(CGAL::parameters::edge_size = epsilon, CGAL::parameters::facet_angle = 25,
                          CGAL::parameters::facet_size = epsilon,
                          CGAL::parameters::cell_radius_edge_ratio = 2,
                          CGAL::parameters::cell_size = epsilon);
  Complex complex =
      optimized ? CGAL::make_mesh_3<Complex>(domain, criteria)
                : CGAL::make_mesh_3<Complex>(domain, criteria, CGAL::parameters::no_perturb(),
                                             CGAL::parameters::no_exude());
  mesh.seconds = ProcessorSeconds() - began;

  std::map<Triangulation::Vertex_handle, Id> ids;
  for (auto cell = complex.cells_in_complex_begin(); cell != complex.cells_in_complex_end();
       ++cell) {
    std::array<Id, 4> corners{};
    for (int i = 0; i < 4; ++i) {
      const auto vertex = cell->vertex(i);
      const auto [entry, is_new] = ids.emplace(vertex, static_cast<Id>(mesh.points.size()));
      if (is_new) {
        const auto& p = vertex->point();
        mesh.points.emplace_back(p.x(), p.y(), p.z());
      }
      corners[static_cast<std::size_t>(i)] = entry->second;
    }
    mesh.cells.push_back(corners);
    mesh.labels.push_back(complex.subdomain_index(cell));
  }
  mesh.note = edges.empty() ? "no edges given"
              : optimized   ? "perturbed and exuded"
                            : "refined alone";
  return mesh;
}

}  // namespace stellate::bench
