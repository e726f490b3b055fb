#include <map>
#include <stdexcept>

#include "core/mesher.h"
#include "tests/bench/peers/meter.h"
#include "tests/bench/solids/solid.h"

namespace stellate::bench {
namespace {

using Eigen::Vector3d;

constexpr int kBisections = 2;  // of the mesh's edges, for curves

// From a, which the curve has, to b along an edge of the boundary, where walls meet.
void Follow(testing::Domain& domain, core::WallSet walls, const Vector3d& a, const Vector3d& b,
            int bisections, Curve* curve) {
  if (bisections == 0) {
    curve->push_back(b);
    return;
  }
  core::QueryBlock middle;
  middle.face = walls;
  middle.points = (a + b) / 2;
  const core::AnswerBlock answer = domain.AnswerOf(middle);
  if (!answer.found[0]) throw std::runtime_error("no point where walls meet");
  const Vector3d m = answer.points.col(0);
  Follow(domain, walls, a, m, bisections - 1, curve);
  Follow(domain, walls, m, b, bisections - 1, curve);
}

// The boundary's edges where walls meet, as curves from corner to corner, or around.
std::vector<Curve> CurvesOf(testing::Domain& domain, const SolidMesh& mesh,
                            const std::vector<core::WallSet>& walls) {
  std::map<Id, std::vector<Id>> next;
  std::map<std::pair<Id, Id>, bool> taken;
  const auto on_edge = [&](Id v) { return core::CountWalls(walls[v]) >= 2; };
  for (const auto& cell : mesh.cells)
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const auto [a, b] = std::minmax(cell[i], cell[j]);
        if (!on_edge(a) || !on_edge(b) || core::CountWalls(walls[a] & walls[b]) < 2) continue;
        if (!taken.emplace(std::pair(a, b), false).second) continue;
        next[a].push_back(b);
        next[b].push_back(a);
      }
  std::vector<Curve> curves;
  const auto walk = [&](Id from, Id to) {
    Curve curve{mesh.points[from]};
    for (Id last = from, v = to;;) {
      taken[std::minmax(last, v)] = true;
      Follow(domain, walls[last] & walls[v], mesh.points[last], mesh.points[v], kBisections,
             &curve);
      if (v == from || next[v].size() != 2) break;
      const Id onward = next[v][0] == last ? next[v][1] : next[v][0];
      last = v, v = onward;
    }
    curves.push_back(curve);
  };
  for (const bool closed : {false, true})
    for (const auto& [v, others] : next)
      if (closed || others.size() != 2)
        for (const Id other : others)
          if (!taken[std::minmax(v, other)]) walk(v, other);
  return curves;
}

}  // namespace

SolidMesh MeshWithStellate(const Solid& solid, double epsilon, std::vector<Curve>* edges) {
  testing::Domain domain = solid.domain;
  core::Specification spec = domain.SpecificationFor(epsilon);
  if (solid.label)
    for (core::WallSet signs = 0; signs < core::SetOfWall(spec.walls); ++signs)
      spec.labels.push_back(static_cast<std::int8_t>(solid.label(signs)));
  SolidMesh mesh;
  std::vector<core::WallSet> walls;
  const double began = ProcessorSeconds();
  auto mesher = core::Mesher::Create(std::move(spec), {.threads = 1});
  if (!mesher) throw std::runtime_error(mesher.error().message);
  while (const auto batch = (*mesher)->NextBatch()) {
    const double asked = ProcessorSeconds();
    const core::Answers answers = domain.AnswersOf(*batch);
    mesh.oracle_seconds += ProcessorSeconds() - asked;
    const auto delta = (*mesher)->Absorb(answers);
    if (!delta) throw std::runtime_error(delta.error().message);
    walls.resize(walls.size() + static_cast<std::size_t>(delta->points.cols()) -
                 delta->walls.size());
    walls.insert(walls.end(), delta->walls.begin(), delta->walls.end());
  }
  const std::vector<Id> simplices = (*mesher)->Simplices();
  mesh.seconds = ProcessorSeconds() - began;

  const Eigen::MatrixXd points = (*mesher)->Points();
  for (Eigen::Index j = 0; j < points.cols(); ++j) mesh.points.emplace_back(points.col(j));
  for (std::size_t s = 0; s < simplices.size(); s += 4)
    mesh.cells.push_back({simplices[s], simplices[s + 1], simplices[s + 2], simplices[s + 3]});
  const std::vector<std::int8_t> labels = (*mesher)->Labels();
  mesh.labels.assign(labels.begin(), labels.end());
  mesh.labels.resize(mesh.cells.size(), 1);  // without labels all is one region
  const core::Certificate& certificate = (*mesher)->report().certificate;
  mesh.note = certificate.certified ? "certified" : certificate.verdict;
  *edges = CurvesOf(domain, mesh, walls);
  return mesh;
}

}  // namespace stellate::bench
