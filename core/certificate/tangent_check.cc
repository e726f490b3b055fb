#include "core/certificate/tangent_check.h"

#include "core/base/message.h"
#include "core/base/random.h"
#include "core/certificate/point_of.h"

namespace stellate::core {
namespace {

constexpr int kVertices = 64;
constexpr double kStep = 0.05;  // of the mesh size
// Of the step: tangent spaces wrong by 0.03 are harmless, by 0.2 refinement diverges; what is not a
// tangent space at all is wrong by about 1.
constexpr double kTolerance = 0.15;
// Position errors of both ends, with a margin.
constexpr double kErrorsOfStep = 4;

}  // namespace

TangentCheck::TangentCheck(const MeshView& mesh, double size, std::uint64_t random_seed)
    : mesh_(mesh), length_(kStep * size) {
  Random random(random_seed, 0x74616e67);
  for (int n = 0; n < kVertices; ++n) {
    const auto v = static_cast<std::uint32_t>(random.Next() % mesh.vertices);
    const Eigen::Map<const Eigen::MatrixXd> tangents(mesh.Tangent(v), mesh.d, mesh.k);
    Eigen::VectorXd any(mesh.d), along(mesh.k);
    for (double& x : any) x = random.NearlyNormal();
    for (double& x : along) x = random.NearlyNormal();
    for (int pass = 0; pass < 2; ++pass) any -= tangents * (tangents.transpose() * any).eval();
    if (any.norm() > 1e-6) steps_.push_back({v, true, length_ * any.normalized()});
    steps_.push_back({v, false, length_ * (tangents * along).normalized()});
  }
}

Eigen::MatrixXd TangentCheck::Questions() const {
  Eigen::MatrixXd points(mesh_.d, static_cast<Eigen::Index>(steps_.size()));
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) = PointOf(mesh_, steps_[i].vertex) + steps_[i].to;
  }
  return points;
}

std::string TangentCheck::Judge(const AnswerBlock& answer, double position_error) const {
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    if (!answer.found.empty() && !answer.found[i]) continue;
    const Step& step = steps_[i];
    const Eigen::VectorXd moved = answer.points.col(j) - PointOf(mesh_, step.vertex);
    const double off = step.across ? moved.norm() : (moved - step.to).norm();
    if (off <= kTolerance * length_ + kErrorsOfStep * position_error) continue;
    return Message(
        "at vertex ", step.vertex, " the tangent space that the oracle gave is not that ",
        "of its closest points: a step of ", Brief(length_),
        step.across ? " across it should come back to the vertex, and comes back "
                    : " along it should stay where it is, and is moved by ",
        Brief(off), step.across ? " away" : "", "; is the manifold really ", mesh_.k,
        "-dimensional there (a wall is no surface, a wire no curve), and are the tangent "
        "bases right?");
  }
  return {};
}

}  // namespace stellate::core
