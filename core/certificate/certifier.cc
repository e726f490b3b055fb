#include "core/certificate/certifier.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/certificate/declared_reach.h"
#include "core/certificate/evidence.h"
#include "core/certificate/fibres.h"
#include "core/certificate/findings.h"
#include "core/certificate/links.h"
#include "core/certificate/probes.h"
#include "core/certificate/shape.h"
#include "core/certificate/shrinking_balls.h"
#include "core/certificate/star_geometry.h"
#include "core/certificate/tangent_check.h"
#include "core/certificate/topology.h"
#include "core/geometry/simplex.h"

namespace stellate::core {
namespace {

// R1 is decided on circumradii in tangent spaces; rounding may differ.
constexpr double kSizeTolerance = 1e-6;
// Positions may be this wrong, as a share of the mesh size, before a mesh is refused: wrong by a
// hundredth they do no harm, by a twentieth refinement breaks for k = 3.
constexpr double kPositionTolerance = 0.05;
constexpr double kNoticeablePositionError = 1e-3;
// A point of a simplex of circumradius R with vertices on M is within reach - sqrt(reach^2 - R^2)
// of M: 0.27 R at R = 0.5 reach, half of R at 0.8 reach. Beyond that M is somewhere else.
constexpr double kBarycentreShare = 0.5;
constexpr double kBarycentreNoise = 0.02;  // of the mesh size, for inexact oracles
// Where M is smooth a barycentre lies straight above its closest point; at a rim it leans over. The
// tangent space there is known from the vertices', to the second order of size over reach.
constexpr double kLean = 0.5;
// Closest points that an oracle may fail to find near the mesh.
constexpr double kUnansweredShare = 0.01;
// Two points of M so much nearer to each other than the mesh size are on two sides of something.
constexpr double kThin = 0.25;
// Answers are taken to be wrong by this share of the mesh size, and by a few roundings, even where
// none is seen to be: what lies nearer together than ten times that is one point.
constexpr double kLeastError = 1e-7;
constexpr double kRounding = 16 * std::numeric_limits<double>::epsilon();
// Step of tangents by differences, as a share of the mesh size: above the noise, below curvature.
constexpr double kDifferenceStep = 0.1;

bool Found(const AnswerBlock& answer, Eigen::Index j) {
  return answer.found.empty() || answer.found[static_cast<std::size_t>(j)] != 0;
}

}  // namespace

// The checks that need no oracle run at construction; then come the rounds of queries:
//   1. barycentres, vertices, coverage probes, small steps that hold given tangent spaces against
//      closest points, and the first step of the balls;
//   2. tangents at the probes' closest points, by differences, if the oracle sends none;
//      and with them the second step of the balls;
//   of a thorough audit, also balls at the barycentres' closest points.
// All answers, and those that were known before, are then held against the mesh.
class Certifier::Impl {
 public:
  Impl(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
       std::vector<double> known)
      : spec_(spec), mesh_(mesh), facts_(facts), seen_(std::move(known)) {
    certificate_.inconsistent_simplices = facts.inconsistent_simplices;
    certificate_.max_circumradius = facts.max_circumradius;
    if (!CheckComplex()) {
      Finish();
      return;
    }
    CheckShape();
    AskFirst();
  }

  const std::vector<QueryBlock>* NextBlocks() const { return finished_ ? nullptr : &blocks_; }

  void Absorb(const std::vector<AnswerBlock>& answers) {
    if (finished_) return;
    // What it says of the oracle's own error the others need.
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      if (roles_[b] == Role::kVertices) JudgeVertices(answers[b]);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      switch (roles_[b]) {
        case Role::kBarycentres:
          JudgeBarycentres(answers[b]);
          break;
        case Role::kVertices:
          break;
        case Role::kProbes:
          TakeProbes(answers[b]);
          break;
        case Role::kDifferences:
          TakeDifferences(answers[b]);
          break;
        case Role::kTangents:
          JudgeTangents(answers[b]);
          break;
        case Role::kBalls:
          balls_->Absorb(answers[b].points, answers[b].found, position_error_);
          break;
        case Role::kFeet:
          feet_->Absorb(answers[b].points, answers[b].found, position_error_);
          break;
      }
    }
    AskMore();
  }

  const Certificate& certificate() const { return certificate_; }
  const std::vector<double>& uncovered() const { return uncovered_; }
  std::vector<double>& seen() { return seen_; }

 private:
  enum class Role { kBarycentres, kVertices, kProbes, kTangents, kDifferences, kBalls, kFeet };

  // A point of M that the mesh must cover.
  struct Probe {
    Eigen::VectorXd x;
    NearestVertex nearest;
    std::vector<double> tangent;  // k x d, C order
  };

  bool CheckComplex() {
    if (mesh_.vertices >= std::numeric_limits<std::uint32_t>::max()) {
      findings_.Refuse(Findings::kComplex, "the mesh has too many vertices to check");
      return false;
    }
    const SimplexList list{mesh_.k, static_cast<std::uint32_t>(mesh_.vertices), mesh_.simplices};
    const std::string malformed = CheckSimplexList(list);
    if (!malformed.empty() || list.size() == 0) {
      findings_.Refuse(Findings::kComplex,
                       malformed.empty() ? "the mesh has no simplices" : malformed);
      return false;
    }
    adjacency_.emplace(list);
    ThrowIfInterrupted();
    Connectivity connectivity;
    LinkReport links;
    ParallelFor(2, [&](int part) {
      if (part == 0)
        connectivity = ComputeConnectivity(*adjacency_);
      else
        links = CheckLinks(*adjacency_);
    });
    certificate_.bad_faces = adjacency_->bad_facets();
    certificate_.closed = certificate_.bad_faces == 0;
    certificate_.components = connectivity.components;
    certificate_.orientable = certificate_.closed && connectivity.orientable;
    certificate_.bad_links = links.bad_links + connectivity.isolated_vertices;
    certificate_.links_are_spheres = certificate_.bad_links == 0;
    certificate_.links_decided_exactly = links.decided_exactly;
    orientation_ = std::move(connectivity.orientation);
    certificate_.euler_characteristic = links.euler_characteristic;

    if (certificate_.components < static_cast<std::uint64_t>(spec_.components)) {
      findings_.Refuse(
          Findings::kComponents,
          Message(
              "the mesh has ", certificate_.components,
              certificate_.components == 1 ? " component" : " components", " where ",
              spec_.components,
              " were declared: give a seed on each, or a smaller epsilon if two came out as one"));
    }
    if (!certificate_.closed) {
      findings_.Refuse(
          Findings::kComplex,
          Message("the mesh is not closed: ", adjacency_->first_bad_facet(),
                  ", where each must be in two; faces like it: ", certificate_.bad_faces));
    }
    if (connectivity.isolated_vertices > 0) {
      findings_.Refuse(Findings::kLinks, Message("vertex ", connectivity.first_isolated,
                                                 " is in no simplex; vertices like it: ",
                                                 connectivity.isolated_vertices));
    }
    if (links.bad_links > 0) {
      findings_.Refuse(Findings::kLinks,
                       Message(links.first_bad_link, "; vertices like it: ", links.bad_links));
    }
    if (facts_.inconsistent_simplices > 0) {
      findings_.Refuse(
          Findings::kConsistency,
          Message(facts_.inconsistent_simplices,
                  " simplices are in the star of one of their vertices but not of all"));
    }
    if (!facts_.converged) {
      findings_.Refuse(Findings::kConvergence,
                       "refinement ended while one of its rules still applied");
    }
    return true;
  }

  void CheckShape() {
    StarGeometry stars = MeasureStars(mesh_, *adjacency_, orientation_);
    orientation_ = {};
    certificate_.unembedded_stars = stars.unembedded_stars;
    reach_ = stars.reach;
    // The link of a star that embeds is the sphere of directions of its tangent space
    // (docs/proof.md, (a)).
    if (certificate_.closed && stars.unembedded_stars == 0)
      certificate_.links_decided_exactly = true;
    if (certificate_.links_are_spheres && !certificate_.links_decided_exactly) {
      findings_.Warn(
          "Some vertex links have the homology of a sphere, but were not shown to be spheres.");
    }
    if (stars.unembedded_stars > 0) {
      findings_.Refuse(Findings::kStars, Message(stars.first_unembedded,
                                                 "; stars like it: ", stars.unembedded_stars));
    }

    const SimplexList& list = adjacency_->list();
    shape_ = MeasureShape(mesh_, list);
    certificate_.max_circumradius =
        std::max(certificate_.max_circumradius, shape_.max_circumradius);
    certificate_.max_radius_edge = shape_.max_radius_edge;
    certificate_.min_fatness = shape_.min_fatness;
    certificate_.min_angle_degrees = shape_.min_angle_degrees;
    certificate_.max_tangent_angle_degrees = shape_.max_tangent_angle_degrees;
    if (!(certificate_.max_circumradius <= spec_.epsilon * (1 + kSizeTolerance))) {
      findings_.Refuse(Findings::kSize,
                       Message("simplex ", NameSimplex(list[shape_.largest], mesh_.k + 1),
                               " has the circumradius ", Brief(shape_.max_circumradius),
                               " (in a tangent space up to ", Brief(certificate_.max_circumradius),
                               "), more than epsilon = ", Brief(spec_.epsilon)));
    }
    size_ = std::min(shape_.max_circumradius, spec_.epsilon);
    if (spec_.declared_reach) HoldDeclaredReach(stars);
    longest_edge_ = std::move(stars.longest_edge);
    narrowest_ = {stars.narrowest_p,
                  (Vertex(stars.narrowest_p) - Vertex(stars.narrowest_q)).norm()};
    balls_.emplace(mesh_, longest_edge_);
    balls_->AddLadders(spec_.random_seed, kBallCount);
    const std::uint64_t step =
        spec_.audit == Audit::kThorough
            ? 1
            : std::max<std::uint64_t>(kBallStride, mesh_.vertices / kMaxBallPairs);
    for (std::uint64_t v = 0; v < mesh_.vertices; v += step) {
      const auto id = static_cast<std::uint32_t>(v);
      balls_->AddPair(id, kPairRadius * LocalSize(id), spec_.random_seed);
    }
  }

  void HoldDeclaredReach(const StarGeometry& stars) {
    const double reach = *spec_.declared_reach;
    declared_.emplace(
        mesh_, ReachClaim{reach, std::asin(std::min(1.0, facts_.tangent_error_length / reach))});
    if (std::isfinite(stars.reach))
      declared_->HoldAgainstEdge(stars.narrowest_p, stars.narrowest_q);
    if (certificate_.closed && stars.unembedded_stars == 0) declared_->Prove(*adjacency_, shape_);
  }

  void Ask(Role role, Eigen::MatrixXd points, bool want_tangents = false) {
    if (points.cols() == 0) return;
    QueryBlock block;
    block.kind = QueryKind::kClosestPoint;
    block.points = std::move(points);
    block.want_tangents = want_tangents;
    blocks_.push_back(std::move(block));
    roles_.push_back(role);
  }

  void AskFirst() {
    const SimplexList& list = adjacency_->list();
    if (spec_.audit == Audit::kThorough) {
      chosen_simplices_.resize(list.size());
      std::iota(chosen_simplices_.begin(), chosen_simplices_.end(), 0u);
      feet_.emplace(mesh_, longest_edge_);
    } else {
      chosen_simplices_ = ChooseSimplices(list, shape_, spec_.random_seed);
    }
    shape_.diameters = {};
    shape_.tilts = {};
    chosen_vertices_ = ChooseVertices(list.vertices, spec_.random_seed);
    Ask(Role::kBarycentres, Barycentres(mesh_, list, chosen_simplices_));
    Eigen::MatrixXd vertices(mesh_.d, static_cast<Eigen::Index>(chosen_vertices_.size()));
    for (std::size_t n = 0; n < chosen_vertices_.size(); ++n) {
      vertices.col(n) = Vertex(chosen_vertices_[n]);
    }
    Ask(Role::kVertices, std::move(vertices));
    Ask(Role::kProbes, CoverageProbes(spec_, mesh_, list, size_), spec_.oracle.tangent_basis);
    if (spec_.oracle.tangent_basis) {
      tangent_check_.emplace(mesh_, size_, spec_.random_seed);
      Ask(Role::kTangents, tangent_check_->Questions());
    }
    Ask(Role::kBalls, balls_->Centres());
  }

  void AskMore() {
    const bool first = ball_steps_++ == 0;
    blocks_.clear();
    roles_.clear();
    if (first && !spec_.oracle.tangent_basis) Ask(Role::kDifferences, DifferencePoints());
    if (ball_steps_ < kMaxBallSteps) Ask(Role::kBalls, balls_->Centres());
    if (feet_ && ball_steps_ <= kMaxBallSteps) Ask(Role::kFeet, feet_->Centres());
    if (blocks_.empty()) Finish();
  }

  // How far from the mesh M may be at a vertex.
  double LocalSize(std::uint32_t v) const {
    return facts_.max_size_ratio > 0 ? std::min(size_, longest_edge_[v]) : size_;
  }

  Eigen::Map<const Eigen::VectorXd> Vertex(std::uint32_t v) const {
    return {mesh_.points + std::size_t{v} * mesh_.d, mesh_.d};
  }

  // The closest point of a simplex' barycentre, against that simplex.
  void HoldFoot(const std::uint32_t* ids, const Eigen::VectorXd& y) {
    for (int i = 0; i <= mesh_.k; ++i) {
      const Eigen::Map<const Eigen::MatrixXd> tangent(mesh_.Tangent(ids[i]), mesh_.d, mesh_.k);
      const Eigen::VectorXd step = y - Vertex(ids[i]);
      const double distance = step.norm();
      const double away = (step - tangent * (tangent.transpose() * step)).norm();
      if (IsTelling(distance, away, longest_edge_[ids[i]], position_error_))
        TakeReach(distance * distance / (2 * away), {ids[i], distance});
    }
  }

  void JudgeTangents(const AnswerBlock& answer) {
    std::string problem = tangent_check_->Judge(answer, position_error_);
    if (!problem.empty()) findings_.Refuse(Findings::kTangents, std::move(problem));
  }

  // How much of a step off M at a simplex lies along M, by its vertices' tangent spaces.
  double Lean(const std::uint32_t* ids, const Eigen::VectorXd& step) const {
    Eigen::VectorXd along = Eigen::VectorXd::Zero(mesh_.d);
    for (int i = 0; i <= mesh_.k; ++i) {
      const Eigen::Map<const Eigen::MatrixXd> tangent(mesh_.Tangent(ids[i]), mesh_.d, mesh_.k);
      along += tangent * (tangent.transpose() * step);
    }
    return along.norm() / (mesh_.k + 1);
  }

  // An orthonormal basis, nearly of the tangent space of M under a simplex.
  Eigen::MatrixXd TangentsUnder(const std::uint32_t* ids) const {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(mesh_.d, mesh_.k);
    const Eigen::Map<const Eigen::MatrixXd> first(mesh_.Tangent(ids[0]), mesh_.d, mesh_.k);
    for (int i = 0; i <= mesh_.k; ++i) {
      const Eigen::Map<const Eigen::MatrixXd> tangent(mesh_.Tangent(ids[i]), mesh_.d, mesh_.k);
      sum += tangent * (tangent.transpose() * first);
    }
    return Eigen::HouseholderQR<Eigen::MatrixXd>(sum).householderQ() *
           Eigen::MatrixXd::Identity(mesh_.d, mesh_.k);
  }

  void JudgeBarycentres(const AnswerBlock& answer) {
    const Eigen::MatrixXd& asked = BlockOf(Role::kBarycentres).points;
    const SimplexList& list = adjacency_->list();
    Eigen::Index unanswered = 0;
    double worst_excess = 0;
    for (Eigen::Index j = 0; j < asked.cols(); ++j) {
      if (!Found(answer, j)) {
        ++unanswered;
        continue;
      }
      const double distance = (answer.points.col(j) - asked.col(j)).norm();
      certificate_.max_barycentre_distance =
          std::max(certificate_.max_barycentre_distance, distance);
      const std::uint32_t* ids = list[chosen_simplices_[static_cast<std::size_t>(j)]];
      const double circumradius = Circumradius(ids);
      if (declared_) declared_->HoldAgainstDistance(ids, circumradius, distance);
      const Eigen::VectorXd step = asked.col(j) - answer.points.col(j);
      if (feet_)
        feet_->AddPair(ids[0], answer.points.col(j), TangentsUnder(ids),
                       kPairRadius * LocalSize(ids[0]),
                       ~(Mix64(spec_.random_seed) + static_cast<std::uint64_t>(j)));
      if (distance > kBarycentreNoise * size_ && Lean(ids, step) > kLean * distance) {
        findings_.Refuse(
            Findings::kRim,
            Message("the manifold may end under simplex ", NameSimplex(ids, mesh_.k + 1),
                    ": its barycentre is ", Brief(distance), " away from the closest point ",
                    NamePoint(answer.points.col(j)),
                    ", and not straight above it; holes and boundaries are not meshed"));
      }
      HoldFoot(ids, answer.points.col(j));
      const double bound =
          kBarycentreShare * std::min(circumradius, spec_.epsilon) + kBarycentreNoise * size_;
      if (distance - bound <= worst_excess) continue;
      worst_excess = distance - bound;
      barycentre_problem_ =
          Message("the barycentre of simplex ", NameSimplex(ids, mesh_.k + 1), " is ",
                  Brief(distance), " away from the manifold, where its size allows ", Brief(bound));
    }
    if (!barycentre_problem_.empty()) {
      findings_.Refuse(Findings::kBarycentres, barycentre_problem_);
    }
    if (unanswered > kUnansweredShare * static_cast<double>(asked.cols())) {
      findings_.Refuse(Findings::kBarycentres,
                       Message("the oracle found no closest point for ", unanswered, " of ",
                               asked.cols(), " barycentres"));
    } else if (unanswered > 0) {
      findings_.Warn(Message("The oracle found no closest point for ", unanswered, " of ",
                             asked.cols(), " barycentres."));
    }
  }

  double Circumradius(const std::uint32_t* ids) const {
    std::array<const double*, kMaxDimension + 1> corners{};
    for (int i = 0; i <= mesh_.k; ++i) corners[i] = mesh_.points + std::size_t{ids[i]} * mesh_.d;
    return MeasureSimplex({corners.data(), static_cast<std::size_t>(mesh_.k) + 1}, mesh_.d)
        .circumradius;
  }

  void JudgeVertices(const AnswerBlock& answer) {
    double worst = 0;
    for (std::size_t n = 0; n < chosen_vertices_.size(); ++n) {
      const std::uint32_t v = chosen_vertices_[n];
      const auto j = static_cast<Eigen::Index>(n);
      if (!Found(answer, j)) {
        findings_.Refuse(Findings::kVertices,
                         Message("the oracle finds no closest point for vertex ", v));
        continue;
      }
      const double error = (answer.points.col(j) - Vertex(v)).norm();
      worst = std::max(worst, error);
      if (error > kPositionTolerance * size_) {
        findings_.Refuse(Findings::kVertices,
                         Message("vertex ", v, " is not on the manifold: its closest point is ",
                                 Brief(error), " away"));
      }
    }
    position_error_ = std::max({worst, kLeastError * size_, kRounding * LargestCoordinate()});
    if (worst > kNoticeablePositionError * size_ && worst <= kPositionTolerance * size_) {
      findings_.Warn(Message("The oracle moves points that it returned itself by up to ",
                             Brief(worst), ", ", Brief(100 * worst / size_),
                             " % of the mesh size: solve to a tighter tolerance."));
    }
  }

  void TakeProbes(const AnswerBlock& answer) {
    std::vector<Eigen::Index> found;
    std::vector<double> points;
    for (Eigen::Index j = 0; j < answer.points.cols(); ++j) {
      if (!Found(answer, j)) continue;
      found.push_back(j);
      points.insert(points.end(), answer.points.col(j).begin(), answer.points.col(j).end());
    }
    const std::vector<NearestVertex> nearest = FindNearestVertices(mesh_, points, size_);
    for (std::size_t n = 0; n < found.size(); ++n) {
      const Eigen::Index j = found[n];
      Probe probe;
      probe.x = answer.points.col(j);
      seen_.insert(seen_.end(), probe.x.begin(), probe.x.end());
      probe.nearest = nearest[n];
      if (probe.nearest.distance > kCoverageShare * size_) {
        ++certificate_.fibre_samples;
        ++certificate_.fibre_failures;
        findings_.Refuse(
            Findings::kCoverage,
            Message("the mesh misses a part of the manifold: its point ", NamePoint(probe.x),
                    " is ", Brief(probe.nearest.distance), " away from the nearest vertex, ",
                    probe.nearest.vertex, ", where the mesh size is ", Brief(size_)));
        continue;
      }
      if (answer.tangents.size() > 0) {
        for (int a = 0; a < mesh_.k; ++a)
          for (int i = 0; i < mesh_.d; ++i)
            probe.tangent.push_back(answer.tangents(i * mesh_.k + a, j));
      } else {
        const double* t = mesh_.Tangent(probe.nearest.vertex);
        probe.tangent.assign(t, t + mesh_.d * mesh_.k);
      }
      probes_.push_back(std::move(probe));
    }
    if (spec_.oracle.tangent_basis) JudgeFibres();
  }

  // The derivative of the closest-point map at a point of M is the projection on the tangent
  // space: small steps along the nearest vertex's tangents come back as tangents of the point.
  Eigen::MatrixXd DifferencePoints() const {
    const Eigen::Index k = mesh_.k;
    Eigen::MatrixXd points(mesh_.d, static_cast<Eigen::Index>(probes_.size()) * k);
    for (std::size_t n = 0; n < probes_.size(); ++n) {
      for (Eigen::Index a = 0; a < k; ++a) {
        auto point = points.col(static_cast<Eigen::Index>(n) * k + a);
        point = probes_[n].x;
        for (int i = 0; i < mesh_.d; ++i) {
          point[i] += kDifferenceStep * size_ *
                      probes_[n].tangent[static_cast<std::size_t>(a * mesh_.d + i)];
        }
      }
    }
    return points;
  }

  void TakeDifferences(const AnswerBlock& answer) {
    const Eigen::Index k = mesh_.k;
    for (std::size_t n = 0; n < probes_.size(); ++n) {
      Eigen::MatrixXd steps(mesh_.d, k);
      bool complete = true;
      for (Eigen::Index a = 0; a < k; ++a) {
        const Eigen::Index j = static_cast<Eigen::Index>(n) * k + a;
        complete = complete && Found(answer, j);
        if (complete) steps.col(a) = answer.points.col(j) - probes_[n].x;
      }
      if (!complete) continue;  // the nearest vertex's tangents have to do
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(steps);
      const Eigen::MatrixXd basis = qr.householderQ() * Eigen::MatrixXd::Identity(mesh_.d, k);
      for (int i = 0; i < mesh_.d; ++i) {
        for (Eigen::Index a = 0; a < k; ++a)
          probes_[n].tangent[static_cast<std::size_t>(a * mesh_.d + i)] = basis(i, a);
      }
    }
    JudgeFibres();
  }

  void JudgeFibres() {
    std::vector<Fibre> fibres;
    for (std::size_t n = 0; n < probes_.size(); ++n)
      fibres.push_back({probes_[n].x.data(), probes_[n].tangent.data(),
                        LocalSize(probes_[n].nearest.vertex), Mix64(spec_.random_seed) + n});
    const std::vector<int> counted = CountHits(mesh_, *adjacency_, shape_.max_diameter, fibres);
    for (std::size_t n = 0; n < probes_.size(); ++n) {
      const Probe& probe = probes_[n];
      const int hits = counted[n];
      if (hits < 0) continue;  // undecided by rounding
      ++certificate_.fibre_samples;
      if (hits == 1) continue;
      ++certificate_.fibre_failures;
      findings_.Refuse(
          Findings::kFibres,
          Message("the normal flat of the manifold at its point ", NamePoint(probe.x),
                  ", near vertex ", probe.nearest.vertex, ", meets the mesh ", hits,
                  " times within ", Brief(LocalSize(probe.nearest.vertex)), " instead of once"));
    }
    probes_.clear();
  }

  double LargestCoordinate() const {
    const MeshBox box = BoxOf(mesh_);
    return std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff());
  }

  // All that was ever answered, against the mesh.
  void JudgeEvidence() {
    for (const auto* balls : {&balls_, &feet_})
      if (*balls) seen_.insert(seen_.end(), (*balls)->met().begin(), (*balls)->met().end());
    const bool graded = facts_.max_size_ratio > 0;
    const std::uint64_t vertices =
        spec_.audit == Audit::kThorough ? mesh_.vertices : kMaxVerticesHeld;
    const Evidence evidence =
        HoldAgainst(mesh_, seen_, longest_edge_, size_, graded, position_error_, vertices);
    coarseness_ = evidence.coarseness;
    TakeReach(evidence.reach, {evidence.vertex, evidence.distance});
    certificate_.answers_held =
        seen_.size() / static_cast<std::size_t>(mesh_.d) + chosen_simplices_.size();
    for (const std::uint64_t i : evidence.uncovered) {
      const double* y = seen_.data() + i * static_cast<std::size_t>(mesh_.d);
      uncovered_.insert(uncovered_.end(), y, y + mesh_.d);
    }
    if (evidence.uncovered.empty()) return;
    const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(uncovered_.data(), mesh_.d);
    findings_.Refuse(
        Findings::kCoverage,
        Message("the mesh misses a part of the manifold: the oracle answered with ", NamePoint(y),
                ", and no vertex is near; answers like it: ", evidence.uncovered.size()));
  }

  // Where M was seen narrow: at a vertex, and how far from there the other side is.
  struct Narrow {
    std::uint32_t vertex = 0;
    double across = 0;
  };
  void TakeReach(double reach, Narrow where) {
    if (reach >= reach_) return;
    reach_ = reach;
    narrowest_ = where;
  }

  void JudgeReach() {
    for (const auto* balls : {&balls_, &feet_}) {
      if (!*balls) continue;
      coarseness_ = std::max(coarseness_, (*balls)->coarseness());
      TakeReach((*balls)->reach(), {(*balls)->narrowest(), (*balls)->distance()});
    }
    certificate_.estimated_reach = reach_;
    const bool graded = facts_.max_size_ratio > 0;
    const double ratio = graded ? std::max(facts_.max_size_ratio, coarseness_) : size_ / reach_;
    certificate_.epsilon_over_reach = graded ? ratio : spec_.epsilon / reach_;
    if (ratio > kCoarse) {
      findings_.Refuse(
          Findings::kReach,
          Message(
              "too coarse to trust: ",
              TooCoarse(ratio, reach_,
                        Message("near vertex ", narrowest_.vertex, " at ",
                                NamePoint(Vertex(narrowest_.vertex)))),
              narrowest_.across < kThin * size_
                  ? Message(". Two points of it there are only ", Brief(narrowest_.across),
                            " apart: if nothing so thin should be there, check the dimension (a "
                            "wall is no surface, a wire no curve)")
                  : std::string()));
    }
    if (spec_.criteria.max_deviation &&
        certificate_.max_barycentre_distance > *spec_.criteria.max_deviation) {
      findings_.Refuse(
          Findings::kDeviation,
          Message(
              "a barycentre lies ", Brief(certificate_.max_barycentre_distance),
              " from the manifold, more than max_deviation = ",
              Brief(*spec_.criteria.max_deviation),
              ": the manifold bends more there than the vertices show; take epsilon smaller, or "
              "max_deviation"));
    }
  }

  const QueryBlock& BlockOf(Role role) const {
    return blocks_[static_cast<std::size_t>(std::find(roles_.begin(), roles_.end(), role) -
                                            roles_.begin())];
  }

  void Finish() {
    finished_ = true;
    if (balls_) {
      JudgeEvidence();
      JudgeReach();
    }
    if (declared_) {
      declared_->HoldAgainstBall(balls_->narrowest(), balls_->reach(), balls_->distance());
      declared_->Conclude(position_error_, facts_.covers_box, findings_, certificate_);
    }
    findings_.Conclude(mesh_.k, spec_, certificate_);
  }

  const Specification spec_;
  const MeshView mesh_;
  const StarFacts facts_;
  Certificate certificate_;
  Findings findings_;
  std::optional<Adjacency> adjacency_;
  std::optional<ShrinkingBalls> balls_;
  std::optional<ShrinkingBalls> feet_;  // of a thorough audit: at the barycentres' closest points
  std::optional<TangentCheck> tangent_check_;
  std::optional<DeclaredReach> declared_;
  std::vector<std::int8_t> orientation_;  // until the stars are measured
  MeshShape shape_;
  double reach_ = 0;
  Narrow narrowest_;
  double coarseness_ = 0;
  double position_error_ = 0;         // of the oracle, as seen at the vertices
  std::vector<double> longest_edge_;  // by vertex
  double size_ = 0;                   // the mesh's own: its largest circumradius, epsilon at most
  std::vector<std::uint32_t> chosen_simplices_, chosen_vertices_;
  std::string barycentre_problem_;
  std::vector<Probe> probes_;
  std::vector<double> seen_;       // points of M that were answered, d each
  std::vector<double> uncovered_;  // those that no vertex is near to
  int ball_steps_ = 0;
  bool finished_ = false;
  std::vector<QueryBlock> blocks_;
  std::vector<Role> roles_;
};

Certifier::Certifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
                     std::vector<double> known)
    : impl_(std::make_unique<Impl>(spec, mesh, facts, std::move(known))) {}
Certifier::~Certifier() = default;

const std::vector<QueryBlock>* Certifier::NextBlocks() { return impl_->NextBlocks(); }
void Certifier::Absorb(const std::vector<AnswerBlock>& answers) { impl_->Absorb(answers); }
const Certificate& Certifier::certificate() const { return impl_->certificate(); }
const std::vector<double>& Certifier::Uncovered() const { return impl_->uncovered(); }
std::vector<double> Certifier::TakeSeen() { return std::move(impl_->seen()); }

}  // namespace stellate::core
