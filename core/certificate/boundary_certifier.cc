// The certificate of a boundary without its inside.

#include <bit>
#include <functional>
#include <optional>
#include <utility>

#include "core/certificate/certifier.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/claims/sheet_claims.h"
#include "core/certificate/claims/surface_claims.h"

namespace stellate::core {
namespace {

// The constructor decides what needs no oracle; then comes one round: barycentres of simplices, and
// points beside the boundary, from which each wall is queried. All answers, and those that were
// known before, are compared with the mesh.
class BoundaryCertifier final : public Certifier {
 public:
  BoundaryCertifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
                    KnownOfManifold known)
      : x_(spec, mesh, facts), known_(std::move(known)), surface_(x_), boundary_(x_) {
    if (surface_.Judge())
      Ask();
    else
      Finish();
  }

  std::vector<QueryBlock> Questions() override {
    return finished_ ? std::vector<QueryBlock>() : blocks_;
  }

  void Absorb(const std::vector<AnswerBlock>& answers) override {
    if (finished_) return;
    for (std::size_t b = 0; b < blocks_.size(); ++b) judges_[b](blocks_[b].points, answers[b]);
    Finish();
  }

  const Certificate& certificate() const override { return x_.certificate; }
  const std::vector<double>& Uncovered() const override { return x_.wanted; }
  const PointsOnWalls& UncoveredOnWalls() const override { return x_.wanted_on_walls; }
  KnownOfManifold TakeKnown() override {
    known_.tangential_offsets.clear();
    return std::move(known_);
  }

 private:
  using Judge = std::function<void(const Eigen::MatrixXd& asked, const AnswerBlock& answer)>;

  void Add(QueryBlock block, Judge judge) {
    if (block.points.cols() == 0) return;
    blocks_.push_back(std::move(block));
    judges_.push_back(std::move(judge));
  }

  void Ask() {
    sheets_.emplace(x_, boundary_, known_.ends, known_.clear);
    for (QueryBlock& block : surface_.VertexQuestions())
      Add(std::move(block), [this](const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
        surface_.JudgeVertices(asked, answer);
      });
    std::vector<QueryBlock> of_faces = boundary_.FaceQuestions();
    for (std::size_t n = 0; n < of_faces.size(); ++n) {
      const auto wall = static_cast<std::size_t>(std::countr_zero(of_faces[n].face));
      Add(std::move(of_faces[n]),
          [this, n, wall](const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
            boundary_.JudgeFace(n, asked, answer);
            sheets_->Judge(wall, asked, answer);
          });
    }
    std::vector<QueryBlock> beside = sheets_->QuestionsFrom(surface_.PointsBeside());
    for (std::size_t wall = 0; wall < beside.size(); ++wall)
      Add(std::move(beside[wall]),
          [this, wall](const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
            sheets_->Judge(wall, asked, answer);
          });
  }

  void Finish() {
    finished_ = true;
    if (sheets_) {
      x_.certificate.estimated_reach = INFINITY;
      sheets_->JudgeKnown();
      boundary_.JudgeReach();
      x_.certificate.answers_checked = known_.ends.walls.size();
    }
    x_.findings.Conclude(x_.mesh.k, x_.spec, x_.certificate);
  }

  Examination x_;
  KnownOfManifold known_;
  SurfaceClaims surface_;
  BoundaryClaims boundary_;
  std::optional<SheetClaims> sheets_;  // if it is a complex
  bool finished_ = false;
  std::vector<QueryBlock> blocks_;
  std::vector<Judge> judges_;
};

}  // namespace

std::unique_ptr<Certifier> Certifier::CreateForBoundary(const Specification& spec,
                                                        const MeshView& mesh,
                                                        const StarFacts& facts,
                                                        KnownOfManifold known) {
  return std::make_unique<BoundaryCertifier>(spec, mesh, facts, std::move(known));
}

}  // namespace stellate::core
