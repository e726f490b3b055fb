#include "core/certificate/certifier.h"

#include <Eigen/Core>
#include <bit>
#include <functional>
#include <optional>
#include <utility>

#include "core/base/interruption.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/claims/closeness_claims.h"
#include "core/certificate/claims/complex_claims.h"
#include "core/certificate/claims/coverage_claims.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/claims/protection_claims.h"
#include "core/certificate/claims/reach_claims.h"
#include "core/certificate/claims/region_claims.h"
#include "core/certificate/claims/sheet_claims.h"
#include "core/certificate/evidence/probes.h"
#include "core/certificate/evidence/undeclared_boundary_check.h"

namespace stellate::core {
namespace {

// The certificate of all of M. The order of queries. The constructor decides what needs no oracle;
// then come rounds:
//   1. points inside simplices, vertices, coverage probes, small steps that compare given tangent
//      spaces with closest points, and the first step of the balls;
//   2. tangents at the probes' closest points, by differences, where neither the oracle nor the
//      answer tells them; the second step of the balls; steps over what may be an undeclared
//      boundary; shorter steps where small ones went wrong;
//   3. in a thorough audit, balls at the barycentres' closest points as well.
// All answers, and those that were known before, are then compared with the mesh.
class MeshCertifier final : public Certifier {
 public:
  MeshCertifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
                KnownOfManifold known)
      : x_(spec, mesh, facts) {
    x_.seen = std::move(known.points);
    ends_ = std::move(known.ends);
    clear_ = std::move(known.clear);
    if (mesh.faces) boundary_.emplace(x_);
    if (const std::optional<StarGeometry> stars = JudgeComplex(x_)) {
      if (mesh.labels) regions_.emplace(x_).Judge();
      claims_.emplace(x_, *stars, known.tangential_offsets);
      AskFirst();
    } else {
      Finish();
    }
  }

  std::vector<QueryBlock> Questions() override {
    return finished_ ? std::vector<QueryBlock>() : blocks_;
  }

  void Absorb(const std::vector<AnswerBlock>& answers) override {
    if (finished_) return;
    // They measure the oracle's own error, which all other judgements need.
    if (ball_steps_ == 0) claims_->closeness.JudgeVertices(answers[vertices_], answers[inside_]);
    if (ball_steps_ == 0 && sheets_) sheets_->JudgeKnown();
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      if (sheets_) Note(blocks_[b].face, answers[b]);
      if (judges_[b]) judges_[b](blocks_[b].points, answers[b]);
    }
    AskMore();
  }

  const Certificate& certificate() const override { return x_.certificate; }
  const std::vector<double>& Uncovered() const override { return x_.wanted; }
  const PointsOnWalls& UncoveredOnWalls() const override { return x_.wanted_on_walls; }
  KnownOfManifold TakeKnown() override {
    return {std::move(x_.seen), {}, std::move(ends_), std::move(clear_)};
  }

 private:
  using Judge = std::function<void(const Eigen::MatrixXd& asked, const AnswerBlock& answer)>;

  struct Claims {
    Claims(Examination& x, const StarGeometry& stars, const std::vector<double>& tangential_offsets)
        : boundary_check(x.size),
          reach(x, stars),
          closeness(x, reach, boundary_check),
          coverage(x, boundary_check) {
      const Eigen::Index d = x.mesh.d,
                         count = static_cast<Eigen::Index>(tangential_offsets.size()) / (2 * d);
      const Eigen::Map<const Eigen::MatrixXd> columns(tangential_offsets.data(), 2 * d, count);
      for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::VectorXd offset = columns.col(i).tail(d);
        boundary_check.Add(columns.col(i).head(d), offset, offset.norm());
      }
    }
    UndeclaredBoundaryCheck boundary_check;
    ReachClaims reach;
    ClosenessClaims closeness;
    CoverageClaims coverage;
  };

  void Ask(Eigen::MatrixXd points, Judge judge, bool with_tangents = false) {
    if (points.cols() == 0) return;
    QueryBlock block;
    block.kind = QueryKind::kClosestPoint;
    block.points = std::move(points);
    block.want.tangents = with_tangents;
    block.want.clearances = boundary_.has_value();
    blocks_.push_back(std::move(block));
    judges_.push_back(std::move(judge));
  }
  // Asks as Ask does, about M alone: a point of M^ beyond a wall counts as not found.
  void AskWithin(Eigen::MatrixXd points, const Judge& judge, bool with_tangents = false) {
    if (!boundary_) return Ask(std::move(points), judge, with_tangents);
    const auto within = [this, judge](const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
      if (!regions_) boundary_->JudgeBeyond(answer);
      AnswerBlock inside = answer;
      const Eigen::Index count = answer.points.cols();
      inside.found.resize(static_cast<std::size_t>(count), 1);
      for (Eigen::Index j = 0; j < count; ++j)
        if (answer.clearances.cols() == count && !IsInside(answer.clearances.col(j)))
          inside.found[static_cast<std::size_t>(j)] = 0;
      judge(asked, inside);
    };
    Ask(std::move(points), within, with_tangents);
  }

  bool IsInside(const Eigen::Ref<const Eigen::VectorXd>& clearances) const {
    return x_.mesh.table ? x_.mesh.table->Of(SignsOf(clearances.data(), x_.spec.walls)) != 0
                         : clearances.minCoeff() >= 0;
  }

  void AskFirst() {
    Claims& c = *claims_;
    inside_ = blocks_.size();
    Ask(c.closeness.InsideQuestions(), [this](const Eigen::MatrixXd& asked, const AnswerBlock& a) {
      const ClosenessClaims& closeness = claims_->closeness;
      if (regions_)
        regions_->JudgeInside(closeness.simplices(), closeness.points_inside(), a);
      else if (boundary_)
        boundary_->JudgeInside(closeness.simplices(), closeness.points_inside(), a);
      claims_->closeness.JudgeInside(asked, a);
    });
    vertices_ = blocks_.size();
    Ask(c.closeness.VertexQuestions(), nullptr);
    AskWithin(
        c.coverage.ProbeQuestions(),
        [&c](const Eigen::MatrixXd& asked, const AnswerBlock& a) {
          c.coverage.JudgeProbes(asked, a);
        },
        x_.spec.oracle.tangent_basis);
    AskTangents();
    AskBalls();
    if (boundary_) AskOnWalls();
  }

  // Calls judge(n, asked, answer) for the n-th block.
  template <typename OfWalls, typename JudgeOne>
  void AskOfEach(OfWalls& claims, std::vector<QueryBlock> blocks, JudgeOne judge) {
    for (std::size_t n = 0; n < blocks.size(); ++n) {
      if (blocks[n].points.cols() == 0) continue;
      blocks_.push_back(std::move(blocks[n]));
      judges_.push_back([&claims, judge, n](const Eigen::MatrixXd& asked, const AnswerBlock& a) {
        (claims.*judge)(n, asked, a);
      });
    }
  }

  void AskOnWalls() {
    const std::size_t first = blocks_.size();
    sheets_.emplace(x_, *boundary_, ends_, clear_);
    AskOfEach(*boundary_, boundary_->FaceQuestions(), &BoundaryClaims::JudgeFace);
    for (std::size_t b = first; b < blocks_.size(); ++b)
      judges_[b] = [this, judge = judges_[b], wall = std::countr_zero(blocks_[b].face)](
                       const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
        judge(asked, answer);
        sheets_->Judge(static_cast<std::size_t>(wall), asked, answer);
      };
    AskOfEach(*sheets_, sheets_->Questions(claims_->closeness.simplices()), &SheetClaims::Judge);
  }

  // Notes clearances of the first round only: the answers to queries where clearances dip must not
  // cause further such queries.
  void Note(WallSet face, const AnswerBlock& answer) {
    if ((face != 0 && ball_steps_ > 0) || regions_) return;
    for (Eigen::Index j = 0; j < answer.clearances.cols(); ++j) {
      CheckInterruption(static_cast<std::size_t>(j));
      if (Found(answer, j))
        clear_.Note(answer.points.col(j).data(), x_.mesh.d, answer.clearances.col(j).data(),
                    x_.spec.walls, face);
    }
  }

  void AskMore() {
    Claims& c = *claims_;
    const bool first = ball_steps_++ == 0;
    blocks_.clear();
    judges_.clear();
    if (first)
      Ask(c.coverage.DifferenceQuestions(),
          [&c](const Eigen::MatrixXd&, const AnswerBlock& a) { c.coverage.JudgeDifferences(a); });
    if (sheets_) AskOfEach(*sheets_, sheets_->QuestionsWhereClearancesDip(), &SheetClaims::Judge);
    AskTangents();
    if (ball_steps_ < kMaxBallSteps) AskBalls();
    if (ball_steps_ <= kMaxBallSteps)
      AskWithin(c.reach.FootQuestions(),
                [&c](const Eigen::MatrixXd&, const AnswerBlock& a) { c.reach.TakeFeet(a); });
    Ask(c.closeness.BoundaryQuestions(),
        [&c](const Eigen::MatrixXd&, const AnswerBlock& a) { c.closeness.JudgeBoundary(a); });
    if (blocks_.empty()) Finish();
  }

  void AskTangents() {
    Claims& c = *claims_;
    Ask(c.closeness.TangentQuestions(),
        [&c](const Eigen::MatrixXd&, const AnswerBlock& a) { c.closeness.JudgeTangents(a); });
  }

  void AskBalls() {
    Claims& c = *claims_;
    AskWithin(c.reach.BallQuestions(),
              [&c](const Eigen::MatrixXd&, const AnswerBlock& a) { c.reach.TakeBalls(a); });
  }

  void Finish() {
    finished_ = true;
    x_.ForgetStars();
    if (claims_) {
      claims_->closeness.JudgeBends();
      claims_->reach.TellWhatBallsMet();
      claims_->reach.TakeEvidence(claims_->coverage.JudgeSeen());
      x_.certificate.answers_checked = x_.seen.size() / static_cast<std::size_t>(x_.mesh.d) +
                                       claims_->closeness.points_compared();
      claims_->reach.Judge();
      if (boundary_) boundary_->JudgeReach();
      claims_->closeness.JudgeDeviation();
      claims_->reach.JudgeDeclared();
      JudgeProtection(x_);
    }
    x_.findings.Conclude(x_.mesh.k, x_.spec, x_.certificate);
  }

  Examination x_;
  std::optional<Claims> claims_;            // if it is a complex
  std::optional<BoundaryClaims> boundary_;  // of a manifold with boundary
  std::optional<RegionClaims> regions_;     // of an arrangement of walls, too
  EndsOfManifold ends_;                     // known before, and answered
  ClearPoints clear_;                       // the same
  std::optional<SheetClaims> sheets_;       // of a manifold with boundary, too
  int ball_steps_ = 0;
  bool finished_ = false;
  std::vector<QueryBlock> blocks_;
  std::vector<Judge> judges_;              // of the blocks; none of the vertices', which come first
  std::size_t inside_ = 0, vertices_ = 0;  // the blocks of these in the first round
};

}  // namespace

std::unique_ptr<Certifier> Certifier::Create(const Specification& spec, const MeshView& mesh,
                                             const StarFacts& facts, KnownOfManifold known) {
  if (spec.boundary_only) return CreateForBoundary(spec, mesh, facts, std::move(known));
  return std::make_unique<MeshCertifier>(spec, mesh, facts, std::move(known));
}

}  // namespace stellate::core
