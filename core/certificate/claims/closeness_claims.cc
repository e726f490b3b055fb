#include "core/certificate/claims/closeness_claims.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/base/message.h"
#include "core/certificate/along.h"
#include "core/certificate/claims/rounding.h"
#include "core/certificate/evidence/probes.h"

namespace stellate::core {
namespace {

// The largest error of positions, as a share of the mesh size: an error of a hundredth does no
// harm, with a twentieth refinement breaks for k = 3.
constexpr double kPositionTolerance = 0.05;
constexpr double kNoticeablePositionError = 1e-3;
// The share of closest points that an oracle may fail to find near the mesh.
constexpr double kUnansweredShare = 0.01;
// The least error assumed of answers, as a share of the mesh size and in roundings, even if none is
// seen: points nearer to each other than ten times that are one point.
constexpr double kLeastError = 1e-7;
constexpr double kRoundingShare = 16 * std::numeric_limits<double>::epsilon();

double LargestCoordinate(const MeshView& mesh) {
  const MeshBox box = BoxOf(mesh);
  return std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff());
}

// Whether the tangential part of `step` at a simplex may be long enough: it is no longer than the
// mean of the parts along the vertices' tangent spaces. Rounding is far below the margin.
bool MayHaveTangentialOffset(const MeshView& mesh, const std::uint32_t* ids,
                             const Eigen::VectorXd& step, double distance) {
  constexpr double kMargin = 1 + 1e-9;
  double sum = 0;
  for (int i = 0; i <= mesh.k; ++i) sum += std::sqrt(SquaredAlong(mesh, ids[i], step.data()));
  return HasTangentialOffset(kMargin * sum / (mesh.k + 1), distance);
}

}  // namespace

ClosenessClaims::ClosenessClaims(Examination& examination, ReachClaims& reach,
                                 UndeclaredBoundaryCheck& boundary_check)
    : x_(examination), reach_(reach), boundary_check_(boundary_check) {
  const SimplexList& list = x_.list();
  if (x_.thorough()) {
    simplices_.resize(list.size());
    std::iota(simplices_.begin(), simplices_.end(), 0u);
    points_inside_ = static_cast<std::uint32_t>(x_.mesh.k) + 2;
  } else {
    simplices_ = ChooseSimplices(list, x_.shape, x_.spec.random_seed);
  }
  x_.shape.diameters = {};
  x_.shape.tilts = {};
  vertices_ = ChooseVertices(list.vertices, x_.spec.random_seed);
}

Eigen::MatrixXd ClosenessClaims::InsideQuestions() const {
  return PointsInside(x_.mesh, x_.list(), simplices_, static_cast<int>(points_inside_));
}

Eigen::MatrixXd ClosenessClaims::VertexQuestions() const {
  Eigen::MatrixXd points(x_.mesh.d, static_cast<Eigen::Index>(vertices_.size()));
  for (std::size_t n = 0; n < vertices_.size(); ++n)
    points.col(static_cast<Eigen::Index>(n)) = x_.Vertex(vertices_[n]);
  return points;
}

Eigen::MatrixXd ClosenessClaims::TangentQuestions() {
  if (!x_.spec.oracle.tangent_basis) return {};
  if (!tangents_) tangents_.emplace(x_);
  return tangents_->Questions();
}

void ClosenessClaims::JudgeVertices(const AnswerBlock& answer, const AnswerBlock& inside) {
  double worst = 0;
  for (std::size_t n = 0; n < vertices_.size(); ++n) {
    const std::uint32_t v = vertices_[n];
    const auto j = static_cast<Eigen::Index>(n);
    if (!Found(answer, j)) {
      x_.findings.Refuse(Findings::kVertices,
                         Message("the oracle finds no closest point for vertex ", v));
      continue;
    }
    const double error = (answer.points.col(j) - x_.Vertex(v)).norm();
    worst = std::max(worst, error);
    if (error > kPositionTolerance * x_.size) {
      x_.findings.Refuse(Findings::kVertices,
                         Message("vertex ", v, " is not on the manifold: its closest point is ",
                                 Brief(error), " away"));
    }
  }
  // With a larger error the answers would have failed the repeat check (core/run/repeat_check.h).
  std::vector<Eigen::Index> found;
  for (Eigen::Index j = 0; j < inside.points.cols(); ++j)
    if (Found(inside, j)) found.push_back(j);
  const double rounding =
      RoundingOf(inside.points(Eigen::all, found), kNoticeablePositionError * x_.size);
  x_.position_error = std::max(
      {worst, rounding, kLeastError * x_.size, kRoundingShare * LargestCoordinate(x_.mesh)});
  if (worst > kNoticeablePositionError * x_.size && worst <= kPositionTolerance * x_.size) {
    x_.findings.Warn(Message("The oracle moves points that it returned itself by up to ",
                             Brief(worst), ", ", Brief(100 * worst / x_.size),
                             " % of the mesh size: solve to a tighter tolerance."));
  }
}

// Returns the part of a step off M at a simplex that lies along M, by its vertices' tangent spaces.
// Under the simplex this is right to the second order of size over reach.
Eigen::VectorXd ClosenessClaims::AlongSimplex(const std::uint32_t* ids,
                                              const Eigen::VectorXd& step) const {
  Eigen::VectorXd along = Eigen::VectorXd::Zero(x_.mesh.d);
  for (int i = 0; i <= x_.mesh.k; ++i) {
    const auto tangent = x_.Tangents(ids[i]);
    along += tangent * (tangent.transpose() * step);
  }
  return along / (x_.mesh.k + 1);
}

void ClosenessClaims::JudgeInside(const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
  Eigen::Index unanswered = 0;
  double worst_excess = 0;
  std::string problem;
  for (Eigen::Index j = 0; j < asked.cols(); ++j) {
    if (!Found(answer, j)) {
      ++unanswered;
      continue;
    }
    const auto number = static_cast<std::uint64_t>(j);
    const bool is_barycentre = number % points_inside_ == 0;
    const std::uint32_t* ids = x_.list()[simplices_[number / points_inside_]];
    const Eigen::VectorXd y = answer.points.col(j), step = asked.col(j) - y;
    const double distance = step.norm();
    const double circumradius = x_.Circumradius(ids);
    reach_.TakeFoot(ids, circumradius, distance, y,
                    is_barycentre ? std::optional(number) : std::nullopt);
    if (!x_.AtBoundary(ids) && MayHaveTangentialOffset(x_.mesh, ids, step, distance))
      boundary_check_.Add(y, AlongSimplex(ids, step), distance);
    if (is_barycentre) {
      x_.certificate.max_barycentre_distance =
          std::max(x_.certificate.max_barycentre_distance, distance);
      if (x_.spec.criteria.max_deviation && distance > *x_.spec.criteria.max_deviation)
        deviating_.insert(deviating_.end(), y.begin(), y.end());
    }
    const double bound = x_.DistanceAllowed(circumradius);
    if (distance - bound <= worst_excess) continue;
    worst_excess = distance - bound;
    problem = Message(is_barycentre ? "the barycentre" : "a point", " of simplex ",
                      NameSimplex(ids, x_.mesh.k + 1), " is ", Brief(distance),
                      " away from the manifold, where its size allows ", Brief(bound));
  }
  if (!problem.empty()) x_.findings.Refuse(Findings::kBarycentres, std::move(problem));
  if (unanswered > kUnansweredShare * static_cast<double>(asked.cols())) {
    x_.findings.Refuse(Findings::kBarycentres,
                       Message("the oracle found no closest point for ", unanswered, " of ",
                               asked.cols(), " barycentres"));
  } else if (unanswered > 0) {
    x_.findings.Warn(Message("The oracle found no closest point for ", unanswered, " of ",
                             asked.cols(), " barycentres."));
  }
}

void ClosenessClaims::JudgeTangents(const AnswerBlock& answer) {
  std::string problem = tangents_->Judge(answer);
  if (!problem.empty()) x_.findings.Refuse(Findings::kTangents, std::move(problem));
}

void ClosenessClaims::JudgeBends() {
  if (!tangents_) return;
  for (const TangentCheck::Bend& bend : tangents_->bends())
    reach_.TakePoint(bend.vertex, bend.y, TangentCheck::kTolerance);
}

void ClosenessClaims::JudgeBoundary(const AnswerBlock& answer) {
  std::string problem = boundary_check_.Judge(answer, x_.position_error);
  if (!problem.empty()) x_.findings.Refuse(Findings::kUndeclaredBoundary, std::move(problem));
}

void ClosenessClaims::JudgeDeviation() {
  if (deviating_.empty()) return;
  x_.wanted.insert(x_.wanted.end(), deviating_.begin(), deviating_.end());
  x_.findings.Refuse(
      Findings::kDeviation,
      Message(
          "a barycentre lies ", Brief(x_.certificate.max_barycentre_distance),
          " from the manifold, more than max_deviation = ", Brief(*x_.spec.criteria.max_deviation),
          ": the manifold bends more there than the vertices show; take epsilon smaller, or "
          "max_deviation"));
}

}  // namespace stellate::core
