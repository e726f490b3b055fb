#include "core/certificate/claims/coverage_claims.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

#include "core/base/dense.h"
#include "core/base/message.h"
#include "core/base/random.h"
#include "core/certificate/evidence/probes.h"

namespace stellate::core {
namespace {

// Step of tangents by differences, as a share of the mesh size: above the noise, below curvature.
constexpr double kDifferenceStep = 0.1;

// The normal that an answer tells is read so many position errors from M: they turn it by a
// hundredth.
constexpr double kErrorsInNormal = 100;
// What the vertices near by know of a tangent space must differ from that normal by no more (a
// sine) for the two to be relied on. In codimension 1 the normal alone tells all, and only where M
// ends or has a crease is it far off.
constexpr double kMostOff = 0.03, kMostOffAlone = 0.3;

// Returns why a mesh may miss the point x of M, to be appended. Empty for a point in the box.
std::string WhyMissed(const Specification& spec, const Eigen::VectorXd& x, double size) {
  if (!spec.bounding_box) return {};
  const auto& [lower, upper] = *spec.bounding_box;
  const double beyond = (x - x.cwiseMax(lower).cwiseMin(upper)).norm();
  if (beyond <= size) return {};
  return Message("; that point lies ", Brief(beyond),
                 " outside of the bounding box, in which components are looked for: give a box "
                 "that holds all of the manifold, or keep the components that seeds lie on (in "
                 "Python keep=\"seeds\")");
}

}  // namespace

Eigen::MatrixXd CoverageClaims::ProbeQuestions() const {
  return CoverageProbes(x_.spec, x_.mesh, x_.list(), x_.size);
}

void CoverageClaims::JudgeProbes(const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
  std::vector<Eigen::Index> found;
  std::vector<double> points;
  for (Eigen::Index j = 0; j < answer.points.cols(); ++j) {
    if (!Found(answer, j)) continue;
    found.push_back(j);
    points.insert(points.end(), answer.points.col(j).begin(), answer.points.col(j).end());
  }
  x_.seen.insert(x_.seen.end(), points.begin(), points.end());
  const std::vector<NearestVertex> nearest = FindNearestVertices(x_.mesh, points, x_.size);
  for (std::size_t n = 0; n < found.size(); ++n) {
    const Eigen::Index j = found[n];
    Probe probe{answer.points.col(j), nearest[n], {}, false, asked.col(j)};
    if (probe.nearest.distance > kCoverageShare * x_.size) {
      ++x_.certificate.fibre_samples;
      Fail(probe);
      x_.findings.Refuse(
          Findings::kCoverage,
          Message("the mesh misses a part of the manifold: its point ", NamePoint(probe.x), " is ",
                  Brief(probe.nearest.distance), " away from the nearest vertex, ",
                  probe.nearest.vertex, ", where the mesh size is ", Brief(x_.size),
                  WhyMissed(x_.spec, probe.x, x_.size)));
      continue;
    }
    if (answer.tangents.size() > 0) {
      for (int a = 0; a < x_.mesh.k; ++a)
        for (int i = 0; i < x_.mesh.d; ++i)
          probe.tangent.push_back(answer.tangents(i * x_.mesh.k + a, j));
      probe.knows_tangent = true;
    } else {
      const double* t = x_.mesh.Tangent(probe.nearest.vertex);
      probe.tangent.assign(t, t + x_.mesh.d * x_.mesh.k);
    }
    // At the boundary the flat may miss the mesh by as much as the boundary bends.
    if (x_.mesh.WallsOf(probe.nearest.vertex) != 0) continue;
    if (answer.tangents.size() > 0)
      NoteOffset(probe);
    else
      ReadTangent(&probe);
    probes_.push_back(std::move(probe));
  }
  if (std::all_of(probes_.begin(), probes_.end(), [](const Probe& p) { return p.knows_tangent; }))
    JudgeFibres();
}

// REQUIRES: the probe's own tangent space is known: another vertex's says little of an offset's
// direction.
void CoverageClaims::NoteOffset(const Probe& probe) {
  const Eigen::Map<const Eigen::MatrixXd> tangent(probe.tangent.data(), x_.mesh.d, x_.mesh.k);
  const Eigen::VectorXd step = probe.asked - probe.x;
  boundary_check_.Add(probe.x, tangent * (tangent.transpose() * step), step.norm());
}

// Returns an orthonormal basis of the tangent space at a probe as the vertices of the simplex under
// it have it, d x k: interpolated, it is right to the second order of size over reach.
Eigen::MatrixXd CoverageClaims::TangentsNear(const Probe& probe) const {
  const Eigen::Index k = x_.mesh.k;
  const std::uint32_t* under = nullptr;
  double nearest = INFINITY;
  for (const std::uint32_t s : x_.stars->Star(probe.nearest.vertex)) {
    const std::uint32_t* ids = x_.list()[s];
    Eigen::VectorXd barycentre = Eigen::VectorXd::Zero(x_.mesh.d);
    for (Eigen::Index i = 0; i <= k; ++i) barycentre += x_.Vertex(ids[i]);
    const double distance2 = (barycentre / static_cast<double>(k + 1) - probe.x).squaredNorm();
    if (distance2 >= nearest) continue;
    nearest = distance2;
    under = ids;
  }
  const auto guess = x_.Tangents(probe.nearest.vertex);
  if (!under) return guess;
  Eigen::MatrixXd edges(x_.mesh.d, k);
  for (Eigen::Index i = 0; i < k; ++i) edges.col(i) = x_.Vertex(under[i + 1]) - x_.Vertex(under[0]);
  const Eigen::VectorXd share = LeastSquares(edges, probe.x - x_.Vertex(under[0]));
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(x_.mesh.d, k);
  for (Eigen::Index i = 0; i <= k; ++i) {
    const auto tangents = x_.Tangents(under[i]);
    sum += (i == 0 ? 1 - share.sum() : share[i - 1]) * tangents * (tangents.transpose() * guess);
  }
  return OrthonormalBasis(sum, k);
}

// Turns what the vertices near a probe know of its tangent space by what the one normal that its
// answer tells is off, if it is little.
void CoverageClaims::ReadTangent(Probe* probe) const {
  const Eigen::VectorXd step = probe->asked - probe->x;
  if (!(step.norm() > kErrorsInNormal * x_.position_error)) return;
  const Eigen::VectorXd normal = step.normalized();
  const Eigen::MatrixXd near = TangentsNear(*probe);
  const Eigen::VectorXd off = near.transpose() * normal;
  if (off.norm() > (x_.mesh.d == x_.mesh.k + 1 ? kMostOffAlone : kMostOff)) return;
  const Eigen::MatrixXd basis = OrthonormalBasis(near - normal * off.transpose(), x_.mesh.k);
  probe->tangent.assign(basis.data(), basis.data() + basis.size());
  probe->knows_tangent = true;
}

// The derivative of the closest-point map at a point of M is the projection on the tangent space:
// small steps along the nearest vertex's tangents come back as tangents of the point.
Eigen::MatrixXd CoverageClaims::DifferenceQuestions() const {
  const Eigen::Index k = x_.mesh.k;
  const auto open = std::count_if(probes_.begin(), probes_.end(),
                                  [](const Probe& p) { return !p.knows_tangent; });
  Eigen::MatrixXd points(x_.mesh.d, open * k);
  Eigen::Index next = 0;
  for (const Probe& probe : probes_) {
    if (probe.knows_tangent) continue;
    const Eigen::Map<const Eigen::MatrixXd> tangents(probe.tangent.data(), x_.mesh.d, k);
    points.middleCols(next, k) = (kDifferenceStep * x_.size * tangents).colwise() + probe.x;
    next += k;
  }
  return points;
}

void CoverageClaims::JudgeDifferences(const AnswerBlock& answer) {
  const Eigen::Index k = x_.mesh.k;
  Eigen::Index next = 0;
  for (Probe& probe : probes_) {
    if (probe.knows_tangent) continue;
    const Eigen::Index first = std::exchange(next, next + k);
    bool complete = true;
    for (Eigen::Index a = 0; a < k; ++a) complete = complete && Found(answer, first + a);
    if (!complete) continue;  // the nearest vertex's tangents are used
    const Eigen::MatrixXd basis =
        OrthonormalBasis(answer.points.middleCols(first, k).colwise() - probe.x, k);
    probe.tangent.assign(basis.data(), basis.data() + basis.size());
    NoteOffset(probe);
  }
  JudgeFibres();
}

void CoverageClaims::JudgeFibres() {
  std::vector<Fibre> fibres;
  for (std::size_t n = 0; n < probes_.size(); ++n)
    fibres.push_back({probes_[n].x.data(), probes_[n].tangent.data(),
                      x_.LocalSize(probes_[n].nearest.vertex), Mix64(x_.spec.random_seed) + n});
  const std::vector<FibreHits> hits = CountHits(x_.mesh, *x_.stars, x_.shape.max_diameter, fibres);
  for (std::size_t n = 0; n < probes_.size(); ++n) JudgeHits(probes_[n], hits[n]);
  probes_.clear();
}

void CoverageClaims::Fail(const Probe& probe) {
  ++x_.certificate.fibre_failures;
  std::vector<std::uint32_t>& near = x_.certificate.violations.fibres;
  const auto place = std::lower_bound(near.begin(), near.end(), probe.nearest.vertex);
  if (place != near.end() && *place == probe.nearest.vertex) return;
  near.insert(place, probe.nearest.vertex);
  if (near.size() > Violations::kMost) near.pop_back();
}

// Whether a point is beyond a facet of the boundary near a vertex, by no more than the boundary may
// bend.
bool CoverageClaims::IsBeyondFacet(const Eigen::VectorXd& x, std::uint32_t vertex) const {
  const auto is_near = [&](const std::uint32_t* ids) {
    for (int i = 0; i <= x_.mesh.k; ++i) {
      WallSet common = ~WallSet{0};
      std::vector<std::uint32_t> corners;
      for (int j = 0; j <= x_.mesh.k; ++j) {
        if (j == i) continue;
        common &= x_.mesh.WallsOf(ids[j]);
        corners.push_back(ids[j]);
      }
      if (common == 0) continue;
      Eigen::MatrixXd along(x_.mesh.d, x_.mesh.k - 1);
      for (int j = 1; j < x_.mesh.k; ++j)
        along.col(j - 1) = x_.Vertex(corners[static_cast<std::size_t>(j)]) - x_.Vertex(corners[0]);
      const Eigen::VectorXd step = x - x_.Vertex(corners[0]);
      const double away = (step - along * LeastSquares(along, step)).norm();
      if (away <= x_.DistanceAllowed(x_.Circumradius(ids))) return true;
    }
    return false;
  };
  for (const std::uint32_t s : x_.stars->Star(vertex))
    for (int i = 0; i <= x_.mesh.k; ++i)
      for (const std::uint32_t t : x_.stars->Star(x_.list()[s][i]))
        if (is_near(x_.list()[t])) return true;
  return false;
}

void CoverageClaims::JudgeHits(const Probe& probe, const FibreHits& hits) {
  if (hits.count < 0) return;  // undecided by rounding
  if (x_.IsLonePoint(probe.x.data())) return;
  if (hits.count == 0 && x_.mesh.walls && IsBeyondFacet(probe.x, probe.nearest.vertex)) return;
  ++x_.certificate.fibre_samples;
  const double size = x_.LocalSize(probe.nearest.vertex);
  if (hits.count != 1) {
    Fail(probe);
    x_.findings.Refuse(Findings::kFibres,
                       Message("the normal flat of the manifold at its point ", NamePoint(probe.x),
                               ", near vertex ", probe.nearest.vertex, ", meets the mesh ",
                               hits.count, " times within ", Brief(size), " instead of once"));
    return;
  }
  const double bound =
      x_.DistanceAllowed(x_.Circumradius(x_.list()[hits.simplex])) + kSideStep * size;
  if (hits.distance <= bound) return;
  Fail(probe);
  x_.findings.Refuse(
      Findings::kFibres,
      Message("the mesh lies ", Brief(hits.distance), " above the manifold at its point ",
              NamePoint(probe.x), ", where its size allows ", Brief(bound)));
}

Evidence CoverageClaims::JudgeSeen() {
  const std::uint64_t vertices = x_.thorough() ? x_.mesh.vertices : kMaxVerticesCompared;
  Evidence evidence = CompareWithMesh(x_.mesh, x_.seen, x_.longest_edge, x_.size, x_.graded(),
                                      x_.position_error, vertices);
  const auto at = [&](std::uint64_t i) {
    return x_.seen.data() + i * static_cast<std::size_t>(x_.mesh.d);
  };
  if (std::erase_if(evidence.uncovered, [&](std::uint64_t i) { return x_.IsLonePoint(at(i)); }) > 0)
    x_.findings.Warn(Message(
        "The manifold has a point by itself, where a wall touches a corner of the others, at ",
        NamePoint(Eigen::Map<const Eigen::VectorXd>(x_.facts.lone_points.data(), x_.mesh.d)),
        ": the mesh does without it."));
  if (evidence.uncovered.empty()) return evidence;
  for (const std::uint64_t i : evidence.uncovered) {
    const double* y = at(i);
    x_.wanted.insert(x_.wanted.end(), y, y + x_.mesh.d);
  }
  const Eigen::VectorXd first = Eigen::Map<const Eigen::VectorXd>(x_.wanted.data(), x_.mesh.d);
  x_.findings.Refuse(Findings::kCoverage,
                     Message("the mesh misses a part of the manifold: the oracle answered with ",
                             NamePoint(first), ", and no vertex is near; answers like it: ",
                             evidence.uncovered.size(), WhyMissed(x_.spec, first, x_.size)));
  return evidence;
}

}  // namespace stellate::core
