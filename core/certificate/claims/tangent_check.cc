#include "core/certificate/claims/tangent_check.h"

#include <utility>

#include "core/base/message.h"
#include "core/base/random.h"

namespace stellate::core {
namespace {

constexpr int kVertices = 64;
constexpr double kStep = 0.05;  // of the mesh size
// The length of the second step, as a share of one that failed. A wrong tangent space is as wrong
// for it; the bend of M within a step falls with its square.
constexpr double kShorter = 0.1;
// Position errors of both ends, with a margin.
constexpr double kErrorsOfStep = 4;

}  // namespace

TangentCheck::TangentCheck(const Examination& examination) : x_(examination) {
  const MeshView& mesh = x_.mesh;
  Random random(x_.spec.random_seed, 0x74616e67);
  for (int n = 0; n < kVertices; ++n) {
    const auto v = static_cast<std::uint32_t>(random.Next() % mesh.vertices);
    const auto tangents = x_.Tangents(v);
    const double length = kStep * x_.LocalSize(v);
    Eigen::VectorXd any(mesh.d), along(mesh.k);
    for (double& x : any) x = random.NearlyNormal();
    for (double& x : along) x = random.NearlyNormal();
    for (int pass = 0; pass < 2; ++pass) any -= tangents * (tangents.transpose() * any).eval();
    if (any.norm() > 1e-6) steps_.push_back({v, true, length, length * any.normalized(), {}});
    steps_.push_back({v, false, length, length * (tangents * along).normalized(), {}});
  }
}

Eigen::MatrixXd TangentCheck::Questions() const {
  Eigen::MatrixXd points(x_.mesh.d, static_cast<Eigen::Index>(steps_.size()));
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) = x_.Vertex(steps_[i].vertex) + steps_[i].to;
  }
  return points;
}

std::string TangentCheck::Judge(const AnswerBlock& answer) {
  const double noise = kErrorsOfStep * x_.position_error;
  std::vector<Step> shorter;
  std::string problem;
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    Step& step = steps_[i];
    if (!Found(answer, j)) continue;
    const Eigen::VectorXd moved = answer.points.col(j) - x_.Vertex(step.vertex);
    const double off = step.across ? moved.norm() : (moved - step.to).norm();
    const bool is_first = step.answer.size() == 0;
    if (off <= kTolerance * step.length + noise) {
      if (!is_first) bends_.push_back({step.vertex, std::move(step.answer)});
    } else if (is_first && noise < kTolerance * kShorter * step.length) {
      step.length *= kShorter;
      step.to *= kShorter;
      step.answer = answer.points.col(j);
      shorter.push_back(std::move(step));
    } else if (problem.empty()) {  // also if noise would hide the result of a shorter step
      problem = Accuse(step, off);
    }
  }
  steps_ = std::move(shorter);
  return problem;
}

std::string TangentCheck::Accuse(const Step& step, double off) const {
  return Message("at vertex ", step.vertex, " the tangent space that the oracle gave is not that ",
                 "of its closest points: a step of ", Brief(step.length),
                 step.across ? " across it should come back to the vertex, and comes back "
                             : " along it should stay where it is, and is moved by ",
                 Brief(off), step.across ? " away" : "", "; is the manifold really ", x_.mesh.k,
                 "-dimensional there (a wall is no surface, a wire no curve), and are the tangent "
                 "bases right?");
}

}  // namespace stellate::core
