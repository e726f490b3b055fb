#include "core/certificate/claims/complex_claims.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/complex/closed_betti.h"
#include "core/certificate/complex/links.h"
#include "core/certificate/measure/together.h"

namespace stellate::core {
namespace {

// Whether the simplices are a complex. If not, refuses them.
bool IsComplex(Examination& x) {
  if (x.mesh.vertices >= std::numeric_limits<std::uint32_t>::max()) {
    x.findings.Refuse(Findings::kComplex, "the mesh has too many vertices to check");
    return false;
  }
  const SimplexList list{x.mesh.k, static_cast<std::uint32_t>(x.mesh.vertices), x.mesh.simplices};
  const std::string malformed = CheckSimplexList(list);
  if (!malformed.empty() || list.size() == 0) {
    x.findings.Refuse(Findings::kComplex,
                      malformed.empty() ? "the mesh has no simplices" : malformed);
    return false;
  }
  x.stars.emplace(list);
  return true;
}

// Returns what to look for if a mesh with walls does not end where its faces are.
std::string AboutItsEnd(const Examination& x) {
  WallSet met = 0;
  for (std::uint32_t v = 0; v < x.mesh.vertices; ++v) met |= x.mesh.WallsOf(v);
  return Message("; ", x.mesh.vertices, " stands for what is beyond the boundary") +
         AboutInactiveWall(x.spec.walls, met);
}

// The topology of the complex: a closed manifold, until something else is found.
struct Topology {
  Connectivity connectivity;
  LinkReport links;
  std::uint64_t bad_facets = 0;
  std::string first_bad_facet;
  std::vector<std::uint32_t> some_bad_facets;
};

void RefuseWhatIsNoManifold(Examination& x, const Topology& topology) {
  const Connectivity& connectivity = topology.connectivity;
  const LinkReport& links = topology.links;
  const Certificate& c = x.certificate;
  if (c.components < static_cast<std::uint64_t>(x.spec.components)) {
    x.findings.Refuse(
        Findings::kComponents,
        Message(
            "the mesh has ", c.components, c.components == 1 ? " component" : " components",
            " where ", x.spec.components,
            " were declared: give a seed on each, or a smaller epsilon if two came out as one"));
  }
  if (!c.closed) {
    x.findings.Refuse(Findings::kComplex,
                      Message(x.mesh.faces ? "the mesh does not end where its faces are: "
                                           : "the mesh is not closed: ",
                              topology.first_bad_facet,
                              ", where each must be in two; faces like it: ", c.bad_faces,
                              x.mesh.faces ? AboutItsEnd(x) : std::string()));
  }
  if (connectivity.isolated_vertices > 0) {
    x.findings.Refuse(Findings::kLinks, Message("vertex ", connectivity.some_isolated.front(),
                                                " is in no simplex; vertices like it: ",
                                                connectivity.isolated_vertices));
  }
  if (links.bad_links > 0) {
    x.findings.Refuse(Findings::kLinks,
                      Message(links.first_bad_link, "; vertices like it: ", links.bad_links));
  }
}

void RefuseWhatIsUnfinished(Examination& x) {
  if (x.facts.inconsistent_simplices > 0) {
    x.findings.Refuse(
        Findings::kConsistency,
        Message(x.facts.inconsistent_simplices,
                " simplices are in the star of one of their vertices but not of all"));
  }
  if (!x.facts.converged) {
    x.findings.Refuse(Findings::kConvergence,
                      "refinement ended while one of its rules still applied");
  }
}

// Computes the topology from adjacency; for manifolds with boundary, of the complex closed off.
Topology ExamineTopology(const Adjacency& adjacency, const ClosedOff* closed_off) {
  ThrowIfInterrupted();
  const int k = adjacency.list().k;
  std::optional<Adjacency> closed_adjacency;
  if (closed_off) closed_adjacency.emplace(closed_off->list(k), closed_off->apex);
  const Adjacency& closed = closed_adjacency ? *closed_adjacency : adjacency;
  Topology topology;
  ParallelFor(2, [&](int part) {
    if (part == 0)
      topology.connectivity = ComputeConnectivity(adjacency);
    else
      topology.links = CheckLinks(closed, closed_off ? closed_off->apex : VertexStars::kNone);
  });
  topology.bad_facets = closed.bad_facets();
  topology.first_bad_facet = closed.first_bad_facet();
  topology.some_bad_facets = closed.some_bad_facets();
  if (closed_off) {
    for (std::uint32_t& id : topology.some_bad_facets) id = closed_off->Original(id);
    for (std::uint32_t& id : topology.links.some_bad) id = closed_off->Original(id);
  }
  return topology;
}

// Takes the vertices that are left out on purpose from the isolated ones. Those named are the first
// of all, so that they are looked for again.
void ForgetUnused(const Examination& x, Connectivity* connectivity) {
  if (!x.mesh.unused || connectivity->isolated_vertices == 0) return;
  connectivity->isolated_vertices = 0;
  connectivity->some_isolated.clear();
  for (std::uint32_t v = 0; v < x.mesh.vertices; ++v) {
    CheckInterruption(v);
    if (x.mesh.IsUnused(v) || !x.stars->Star(v).empty()) continue;
    if (connectivity->isolated_vertices++ < Violations::kMost)
      connectivity->some_isolated.push_back(v);
  }
}

// Measures the stars. Unless all of them embed, also examines the topology by adjacency, to find
// what is wrong.
StarGeometry MeasureComplex(Examination& x, const ClosedOff* closed, Topology* topology) {
  if (std::optional<EmbeddedStars> embedded = MeasureIfEmbedded(x.mesh, *x.stars)) {
    topology->connectivity = std::move(embedded->connectivity);
    topology->links.euler_characteristic = embedded->euler_characteristic;
    return std::move(embedded->geometry);
  }
  Adjacency adjacency(std::move(*x.stars));
  *topology = ExamineTopology(adjacency, closed);
  StarGeometry stars = MeasureStars(x.mesh, adjacency, topology->connectivity.orientation);
  *x.stars = std::move(adjacency);
  ForgetUnused(x, &topology->connectivity);
  return stars;
}

void JudgeTopology(Examination& x, const ClosedOff* closed, const Topology& topology) {
  const Connectivity& connectivity = topology.connectivity;
  const LinkReport& links = topology.links;
  Certificate& c = x.certificate;
  c.bad_faces = topology.bad_facets;
  c.closed = c.bad_faces == 0;
  c.components = connectivity.components;
  c.orientable = c.closed && connectivity.orientable;
  c.bad_links = links.bad_links + connectivity.isolated_vertices;
  c.links_are_spheres = c.bad_links == 0;
  c.links_decided_exactly = links.decided_exactly;
  c.violations.faces = topology.some_bad_facets;
  std::merge(links.some_bad.begin(), links.some_bad.end(), connectivity.some_isolated.begin(),
             connectivity.some_isolated.end(), std::back_inserter(c.violations.links));
  c.violations.links.resize(std::min(c.violations.links.size(), Violations::kMost));
  c.euler_characteristic = links.euler_characteristic;
  if (closed) BoundaryClaims(x).JudgeFaces(*closed);
  if (closed) x.pinched.insert(closed->copied.begin(), closed->copied.end());
  if (closed && !closed->wrong_parts.empty())
    x.findings.Refuse(Findings::kLinks, closed->wrong_parts);
  RefuseWhatIsNoManifold(x, topology);
  RefuseWhatIsUnfinished(x);
}

void JudgeStars(Examination& x, const StarGeometry& stars) {
  Certificate& c = x.certificate;
  c.violations.stars = stars.some_unembedded;
  c.unembedded_stars = stars.unembedded_stars;
  // The link of a star that embeds is the sphere of directions of its tangent space
  // (docs/using/proof.md, (a)).
  if (c.closed && !x.mesh.faces && stars.unembedded_stars == 0) c.links_decided_exactly = true;
  if (c.links_are_spheres && !c.links_decided_exactly) {
    x.findings.Warn(
        "Some vertex links have the homology of a sphere, but were not shown to be spheres.");
  }
  if (stars.unembedded_stars > 0) {
    x.findings.Refuse(Findings::kStars,
                      Message(stars.first_unembedded, "; stars like it: ", stars.unembedded_stars));
  }
}

void JudgeSize(Examination& x) {
  Certificate& c = x.certificate;
  c.max_circumradius = std::max(c.max_circumradius, x.shape.max_circumradius);
  c.max_radius_edge = x.shape.max_radius_edge;
  c.min_fatness = x.shape.min_fatness;
  c.min_angle_degrees = x.shape.min_angle_degrees;
  c.max_tangent_angle_degrees = x.shape.max_tangent_angle_degrees;
  if (!(c.max_circumradius <= x.spec.epsilon * (1 + kSizeTolerance))) {
    x.findings.Refuse(Findings::kSize,
                      Message("simplex ", NameSimplex(x.list()[x.shape.largest], x.mesh.k + 1),
                              " has the circumradius ", Brief(x.shape.max_circumradius),
                              " (in a tangent space up to ", Brief(c.max_circumradius),
                              "), more than epsilon = ", Brief(x.spec.epsilon)));
  }
  x.size = std::min(x.shape.max_circumradius, x.spec.epsilon);
}

}  // namespace

std::optional<StarGeometry> JudgeComplex(Examination& x) {
  x.certificate.inconsistent_simplices = x.facts.inconsistent_simplices;
  x.certificate.max_circumradius = x.facts.max_circumradius;
  if (!IsComplex(x)) return std::nullopt;
  std::optional<ClosedOff> closed;
  if (x.mesh.faces)
    closed =
        CloseOff(x.mesh, *x.mesh.simplices, 0, [](const FaceMesh& face) { return IsEnd(face); });
  Topology topology;
  StarGeometry stars = MeasureComplex(x, closed ? &*closed : nullptr, &topology);
  JudgeTopology(x, closed ? &*closed : nullptr, topology);
  JudgeStars(x, stars);
  x.shape = std::move(stars.shape);
  JudgeSize(x);
  Certificate& c = x.certificate;
  c.volume = MeasureVolume(x.mesh, x.mesh.k, *x.mesh.simplices);
  if (closed) BoundaryClaims(x).JudgeVolume();
  if (!closed && c.closed && c.links_are_spheres)
    c.betti = ClosedBettiNumbers(x.list(), static_cast<std::int64_t>(c.components),
                                 c.euler_characteristic);
  x.longest_edge = std::move(stars.longest_edge);
  return stars;
}

}  // namespace stellate::core
