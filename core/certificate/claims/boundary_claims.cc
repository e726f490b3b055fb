#include "core/certificate/claims/boundary_claims.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/random.h"
#include "core/certificate/complex/betti.h"
#include "core/certificate/complex/links.h"
#include "core/certificate/evidence/fibres.h"
#include "core/certificate/measure/together.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMaxFaceBarycentres = 500;  // of each face

std::string NameWalls(WallSet walls) {
  std::string name = Message(CountWalls(walls) == 1 ? "wall" : "walls");
  ForEachWall(walls, [&](int wall) { name = Message(name, " ", wall); });
  return name;
}

}  // namespace

void BoundaryClaims::ReportFaces() {
  Certificate& c = x_.certificate;
  const int k = x_.mesh.k;
  std::vector<std::uint32_t> boundary;
  for (const FaceMesh& face : *x_.mesh.faces) {
    const Shape shape = ShapeOf(face.dimension, face.simplices);
    FaceReport report;
    report.walls = face.walls;
    report.dimension = face.dimension;
    report.sides = face.sides;
    report.simplices = face.simplices.size() / (static_cast<std::size_t>(face.dimension) + 1);
    report.components = shape.components;
    report.euler_characteristic = shape.euler_characteristic;
    report.volume = MeasureVolume(x_.mesh, face.dimension, face.simplices);
    report.betti = BettiNumbers(face.dimension, static_cast<std::int64_t>(shape.components),
                                shape.euler_characteristic, face.simplices);
    c.faces.push_back(report);
    if (face.dimension == k - 1 && IsEnd(face))
      boundary.insert(boundary.end(), face.simplices.begin(), face.simplices.end());
  }
  c.boundary_simplices = boundary.size() / static_cast<std::size_t>(k);
  const Shape whole = ShapeOf(k - 1, boundary);
  c.boundary_components = whole.components;
  c.boundary_euler_characteristic = whole.euler_characteristic;
}

void BoundaryClaims::JudgeFaces(const ClosedOff& closed) {
  const int k = x_.mesh.k;
  ReportFaces();
  x_.certificate.euler_characteristic += closed.EulerOfRest(k);
  if (x_.certificate.boundary_simplices == 0 || k < 3) return;  // circles and points have no links
  const std::vector<std::uint32_t> parts = closed.Boundary(k);
  const Adjacency adjacency(SimplexList{k - 1, closed.apex, &parts});
  const LinkReport links = CheckLinks(adjacency);
  if (adjacency.bad_facets() > 0)
    x_.findings.Refuse(Findings::kComplex,
                       Message("the boundary is not closed: ", adjacency.first_bad_facet(),
                               " of it; faces like it: ", adjacency.bad_facets()));
  if (links.bad_links > 0)
    x_.findings.Refuse(Findings::kLinks, Message("in the boundary ", links.first_bad_link,
                                                 "; vertices like it: ", links.bad_links));
}

void BoundaryClaims::JudgeVolume() {
  const Certificate& c = x_.certificate;
  const auto k = static_cast<std::size_t>(x_.mesh.k);
  if (x_.mesh.d != x_.mesh.k) return;
  using Facet = std::array<std::uint32_t, kMaxDimension>;
  std::vector<Facet> ends;
  for (const FaceMesh& face : *x_.mesh.faces)
    if (face.dimension == x_.mesh.k - 1 && IsEnd(face))
      for (std::size_t f = 0; f < face.simplices.size(); f += k)
        std::copy_n(face.simplices.begin() + static_cast<std::ptrdiff_t>(f), k,
                    ends.emplace_back().begin());
  std::sort(ends.begin(), ends.end());
  std::vector<std::uint32_t> boundary;
  std::vector<bool> turned;
  for (std::uint32_t s = 0; s < x_.list().size(); ++s) {
    CheckInterruption(s);
    const std::uint32_t* const ids = x_.list()[s];
    if (!x_.AtBoundary(ids)) continue;
    Eigen::MatrixXd edges(x_.mesh.d, x_.mesh.d);
    for (int i = 0; i < x_.mesh.d; ++i) edges.col(i) = x_.Vertex(ids[i + 1]) - x_.Vertex(ids[0]);
    const bool is_negative = edges.determinant() < 0;
    for (std::size_t out = 0; out <= k; ++out) {
      Facet facet{};
      for (std::size_t i = 0, n = 0; i <= k; ++i)
        if (i != out) facet[n++] = ids[i];
      if (!std::binary_search(ends.begin(), ends.end(), facet)) continue;
      boundary.insert(boundary.end(), facet.begin(), facet.begin() + x_.mesh.k);
      turned.push_back(is_negative != (out % 2 == 1));
    }
  }
  const double enclosed = EnclosedVolume(x_.mesh, boundary, turned);
  if (!AreSameVolumes(enclosed, c.volume))
    x_.findings.Refuse(Findings::kComplex,
                       Message("its simplices have the volume ", Brief(c.volume),
                               " together, and its boundary encloses ", Brief(enclosed),
                               ": some of them overlap"));
}

std::vector<QueryBlock> BoundaryClaims::FaceQuestions() {
  std::vector<QueryBlock> blocks;
  for (const FaceMesh& face : *x_.mesh.faces) {
    if (CountWalls(face.walls) != 1 || face.dimension == 0) continue;
    const auto width = static_cast<std::size_t>(face.dimension) + 1;
    const std::size_t count = face.simplices.size() / width;
    const std::size_t step = std::max<std::size_t>(1, count / kMaxFaceBarycentres);
    std::vector<std::uint32_t> chosen;
    for (std::size_t s = Mix64(x_.spec.random_seed) % step; s < count; s += step)
      chosen.push_back(static_cast<std::uint32_t>(s));
    QueryBlock block;
    block.face = face.walls;
    block.want.clearances = block.want.tangents = true;
    block.points.setZero(x_.mesh.d, static_cast<Eigen::Index>(chosen.size()));
    for (std::size_t n = 0; n < chosen.size(); ++n)
      for (std::size_t i = 0; i < width; ++i)
        block.points.col(static_cast<Eigen::Index>(n)) +=
            x_.Vertex(face.simplices[chosen[n] * width + i]) / static_cast<double>(width);
    blocks.push_back(std::move(block));
    chosen_.push_back(std::move(chosen));
    faces_.push_back(&face);
  }
  return blocks;
}

void BoundaryClaims::JudgeFace(std::size_t block, const Eigen::MatrixXd& asked,
                               const AnswerBlock& answer) {
  const FaceMesh& face = *faces_[block];
  const std::vector<std::uint32_t>& chosen = chosen_[block];
  const auto width = static_cast<std::size_t>(face.dimension) + 1;
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const auto j = static_cast<Eigen::Index>(n);
    const std::uint32_t* ids = face.simplices.data() + chosen[n] * width;
    double diameter = 0;
    for (std::size_t i = 1; i < width; ++i)
      diameter = std::max(diameter, (x_.Vertex(ids[i]) - x_.Vertex(ids[0])).norm());
    const double bound = x_.DistanceAllowed(diameter);
    const double distance =
        Found(answer, j) ? (answer.points.col(j) - asked.col(j)).norm() : INFINITY;
    if (x_.spec.boundary_only)
      x_.certificate.max_barycentre_distance =
          std::max(x_.certificate.max_barycentre_distance, distance);
    if (x_.spec.criteria.max_deviation && distance > *x_.spec.criteria.max_deviation)
      x_.findings.Refuse(
          Findings::kDeviation,
          Message("a barycentre of ", NameWalls(face.walls), " lies ", Brief(distance),
                  " from it, more than max_deviation = ", Brief(*x_.spec.criteria.max_deviation),
                  ": the wall bends more there than the vertices show; take epsilon smaller, or "
                  "max_deviation"));
    if (distance <= bound) continue;
    x_.findings.Refuse(
        Findings::kBarycentres,
        Message("the barycentre of simplex ", NameSimplex(ids, static_cast<int>(width)), " of ",
                NameWalls(face.walls), " is ", Brief(distance),
                " away from that, where its size "
                "allows ",
                Brief(bound)));
  }
}

void BoundaryClaims::JudgeInside(const std::vector<std::uint32_t>& chosen, std::uint32_t each,
                                 const AnswerBlock& answer) {
  if (answer.clearances.size() == 0) return;
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const std::uint32_t* ids = x_.list()[chosen[n]];
    // A simplex at a wall may lie beyond that, by as much as the wall bends.
    WallSet touched = 0;
    for (int i = 0; i <= x_.mesh.k; ++i) touched |= x_.mesh.WallsOf(ids[i]);
    for (std::size_t m = n * each; m < (n + 1) * each; ++m) {
      const auto j = static_cast<Eigen::Index>(m);
      if (!Found(answer, j)) continue;
      int wall = 0;
      while (wall < x_.spec.walls &&
             ((touched & SetOfWall(wall)) != 0 || answer.clearances(wall, j) >= 0))
        ++wall;
      if (wall == x_.spec.walls) continue;
      x_.findings.Refuse(
          Findings::kCoverage,
          Message("the mesh lies beyond wall ", wall, " at ", NamePoint(answer.points.col(j)),
                  ", inside of simplex ", NameSimplex(ids, x_.mesh.k + 1),
                  ": the manifold has a hole there that is smaller than epsilon; take epsilon "
                  "smaller, or give seeds on that wall"));
    }
  }
}

void BoundaryClaims::JudgeBeyond(const AnswerBlock& answer) {
  WallSet met = 0;
  for (const FaceMesh& face : *x_.mesh.faces) met |= face.walls;
  std::vector<double> points;
  std::vector<int> walls;
  for (Eigen::Index j = 0; j < answer.clearances.cols(); ++j) {
    if (!Found(answer, j)) continue;
    WallSet beyond = 0;
    for (int wall = 0; wall < x_.spec.walls; ++wall)
      if (answer.clearances(wall, j) < 0) beyond |= SetOfWall(wall);
    if (beyond == 0 || (beyond & met) != 0) continue;
    walls.push_back(std::countr_zero(beyond));
    points.insert(points.end(), answer.points.col(j).begin(), answer.points.col(j).end());
  }
  const std::vector<NearestVertex> nearest = FindNearestVertices(x_.mesh, points, x_.size);
  for (std::size_t n = 0; n < walls.size(); ++n) {
    if (nearest[n].distance > x_.size) continue;
    const Eigen::Map<const Eigen::VectorXd> at(
        points.data() + n * static_cast<std::size_t>(x_.mesh.d), x_.mesh.d);
    x_.findings.Refuse(
        Findings::kCoverage,
        Message("no vertex is on wall ", walls[n], ", which cuts the manifold: ", NamePoint(at),
                " is beyond it, ", Brief(nearest[n].distance), " from vertex ", nearest[n].vertex,
                "; take epsilon smaller, or give seeds on that wall"));
  }
}

// Bounds the boundary's reach by p and q, on the same wall: by q's distance from p and from the
// wall's tangent space at p, which is orthogonal to the conormal. Does nothing if p is on other
// walls too.
void BoundaryClaims::TakeAt(WallSet walls, std::uint32_t p, const double* q) {
  if (x_.mesh.WallsOf(p) != walls) return;
  const Eigen::VectorXd step =
      Eigen::Map<const Eigen::VectorXd>(q, x_.mesh.d) - Eigen::VectorXd(x_.Vertex(p));
  const Eigen::VectorXd along = x_.Tangents(p).transpose() * step;
  const double out = Eigen::Map<const Eigen::VectorXd>(x_.mesh.Outward(p), x_.mesh.k).dot(along);
  const double away2 = step.squaredNorm() - along.squaredNorm() + out * out;
  const double away = std::sqrt(std::max(away2, 0.0)), length = step.norm();
  if (!IsTelling(length, away, x_.longest_edge[p], x_.position_error)) return;
  const double here = ReachBound(length * length, away);
  ratio_ = std::max(ratio_, x_.size / here);
  if (here >= reach_) return;
  reach_ = here;
  narrowest_ = p;
  narrowest_walls_ = walls;
}

void BoundaryClaims::TakePoint(int wall, const std::uint32_t* ids, const double* y) {
  for (int i = 0; i < x_.mesh.k; ++i) TakeAt(SetOfWall(wall), ids[i], y);
}

void BoundaryClaims::JudgeReach() {
  for (const FaceMesh& face : *x_.mesh.faces) {
    if (CountWalls(face.walls) != 1) continue;
    const auto width = static_cast<std::size_t>(face.dimension) + 1;
    for (std::size_t s = 0; s < face.simplices.size(); s += width)
      for (std::size_t i = 0; i < width; ++i)
        for (std::size_t j = 0; j < width; ++j)
          if (i != j)
            TakeAt(face.walls, face.simplices[s + i], x_.mesh.Point(face.simplices[s + j]));
  }
  Certificate& c = x_.certificate;
  c.estimated_reach = std::min(c.estimated_reach, reach_);
  if (x_.graded()) return;  // the sizes count what is seen there
  c.epsilon_over_reach = std::max(c.epsilon_over_reach, x_.spec.epsilon / reach_);
  if (ratio_ > kCoarse)
    x_.findings.Refuse(
        Findings::kReach,
        Message("too coarse to trust: ",
                TooCoarse(ratio_, reach_,
                          Message("along ", NameWalls(narrowest_walls_), " near vertex ",
                                  narrowest_, " at ", NamePoint(x_.Vertex(narrowest_))))));
}

}  // namespace stellate::core
