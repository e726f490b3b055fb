#include "core/certificate/certifier.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "core/certificate/fibres.h"
#include "core/certificate/findings.h"
#include "core/certificate/links.h"
#include "core/certificate/probes.h"
#include "core/certificate/shape.h"
#include "core/certificate/shrinking_balls.h"
#include "core/certificate/star_geometry.h"
#include "core/certificate/topology.h"
#include "core/geometry/simplex.h"
#include "core/message.h"
#include "core/parallel.h"
#include "core/sample/random.h"

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
// Within a well-sampled M each point has a vertex within its simplex' circumradius and height,
// 1.5 times the mesh size.
constexpr double kCoverageShare = 2;
// eps / reach beyond which there is no theorem and no practice.
constexpr double kHopeless = 1.5;
// Closest points that an oracle may fail to find near the mesh.
constexpr double kUnansweredShare = 0.01;
// Step of tangents by differences, as a share of the mesh size: above the noise, below curvature.
constexpr double kDifferenceStep = 0.1;

std::string NamePoint(const Eigen::VectorXd& x) {
  std::string name = "(";
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(x.size(), 6); ++i) {
    name += Message(i > 0 ? ", " : "", Brief(x[i]));
  }
  return name + (x.size() > 6 ? ", ...)" : ")");
}

bool Found(const AnswerBlock& answer, Eigen::Index j) {
  return answer.found.empty() || answer.found[static_cast<std::size_t>(j)] != 0;
}

}  // namespace

// The checks that need no oracle run at construction; then come the rounds of queries:
//   1. barycentres, vertices, coverage probes, and the first step of the balls;
//   2. tangents at the probes' closest points, by differences, if the oracle sends none;
//      and with them the second step of the balls.
class Certifier::Impl {
 public:
  Impl(const Specification& spec, const MeshView& mesh, const StarFacts& facts)
      : spec_(spec), mesh_(mesh), facts_(facts) {
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
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      switch (roles_[b]) {
        case Role::kBarycentres:
          JudgeBarycentres(answers[b]);
          break;
        case Role::kVertices:
          JudgeVertices(answers[b]);
          break;
        case Role::kProbes:
          TakeProbes(answers[b]);
          break;
        case Role::kDifferences:
          TakeDifferences(answers[b]);
          break;
        case Role::kBalls:
          balls_->Absorb(answers[b].points, answers[b].found);
          break;
      }
    }
    AskMore();
  }

  const Certificate& certificate() const { return certificate_; }

 private:
  enum class Role { kBarycentres, kVertices, kProbes, kDifferences, kBalls };

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
    } else if (!links.decided_exactly) {
      findings_.Warn(
          "Some vertex links have the homology of a sphere, but were not shown to be spheres.");
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
    balls_.emplace(mesh_, stars.longest_edge, spec_.random_seed, kBallCount);
    longest_edge_ = std::move(stars.longest_edge);
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
    chosen_simplices_ = ChooseSimplices(list, shape_, spec_.random_seed);
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
    Ask(Role::kBalls, balls_->Centres());
  }

  void AskMore() {
    const bool first = ball_steps_++ == 0;
    blocks_.clear();
    roles_.clear();
    if (first && !spec_.oracle.tangent_basis) Ask(Role::kDifferences, DifferencePoints());
    if (ball_steps_ < kMaxBallSteps) Ask(Role::kBalls, balls_->Centres());
    if (blocks_.empty()) Finish();
  }

  // How far from the mesh M may be at a vertex.
  double LocalSize(std::uint32_t v) const {
    return facts_.max_size_ratio > 0 ? std::min(size_, longest_edge_[v]) : size_;
  }

  Eigen::Map<const Eigen::VectorXd> Vertex(std::uint32_t v) const {
    return {mesh_.points + std::size_t{v} * mesh_.d, mesh_.d};
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
      const double bound =
          kBarycentreShare * std::min(Circumradius(ids), spec_.epsilon) + kBarycentreNoise * size_;
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

  void JudgeReach() {
    reach_ = std::min(reach_, balls_->reach());
    certificate_.estimated_reach = reach_;
    const bool graded = facts_.max_size_ratio > 0;
    certificate_.epsilon_over_reach =
        graded ? std::max(facts_.max_size_ratio, balls_->coarseness()) : spec_.epsilon / reach_;
    if (graded ? certificate_.epsilon_over_reach > kHopeless : size_ > kHopeless * reach_) {
      findings_.Refuse(Findings::kReach,
                       Message("the mesh size ", Brief(size_), " is ", Brief(size_ / reach_),
                               " times the estimated reach ", Brief(reach_),
                               ", far too coarse to tell the manifold's shape"));
    }
    const double coarse = graded ? certificate_.epsilon_over_reach * reach_ : spec_.epsilon;
    if (std::string w = CoarsenessWarning(coarse, reach_); !w.empty()) findings_.Warn(std::move(w));
    if (spec_.criteria.max_deviation &&
        certificate_.max_barycentre_distance > *spec_.criteria.max_deviation) {
      findings_.Warn(Message(
          "a barycentre lies ", Brief(certificate_.max_barycentre_distance),
          " from the manifold, more than max_deviation = ", Brief(*spec_.criteria.max_deviation),
          ": the curvature was underestimated there; take epsilon smaller."));
    }
  }

  const QueryBlock& BlockOf(Role role) const {
    return blocks_[static_cast<std::size_t>(std::find(roles_.begin(), roles_.end(), role) -
                                            roles_.begin())];
  }

  void Finish() {
    finished_ = true;
    if (balls_) JudgeReach();
    findings_.Conclude(mesh_.k, certificate_);
  }

  const Specification spec_;
  const MeshView mesh_;
  const StarFacts facts_;
  Certificate certificate_;
  Findings findings_;
  std::optional<Adjacency> adjacency_;
  std::optional<ShrinkingBalls> balls_;
  std::vector<std::int8_t> orientation_;  // until the stars are measured
  MeshShape shape_;
  double reach_ = 0;
  std::vector<double> longest_edge_;  // by vertex
  double size_ = 0;                   // the mesh's own: its largest circumradius, epsilon at most
  std::vector<std::uint32_t> chosen_simplices_, chosen_vertices_;
  std::string barycentre_problem_;
  std::vector<Probe> probes_;
  int ball_steps_ = 0;
  bool finished_ = false;
  std::vector<QueryBlock> blocks_;
  std::vector<Role> roles_;
};

Certifier::Certifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts)
    : impl_(std::make_unique<Impl>(spec, mesh, facts)) {}
Certifier::~Certifier() = default;

const std::vector<QueryBlock>* Certifier::NextBlocks() { return impl_->NextBlocks(); }
void Certifier::Absorb(const std::vector<AnswerBlock>& answers) { impl_->Absorb(answers); }
const Certificate& Certifier::certificate() const { return impl_->certificate(); }

}  // namespace stellate::core
