#include "core/run/boundary_detector.h"

#include <cmath>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/vector_ops.h"
#include "core/certificate/evidence/undeclared_boundary_check.h"
#include "core/certificate/findings.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMaxOffsets = 256;  // more would add nothing

}  // namespace

template <int K>
void BoundaryDetector::Look(const CandidateSet<K>& candidates, const Eigen::MatrixXd& asked,
                            const AnsweredPoints& answers) {
  if (!may_tell_) return;
  const Eigen::Index d = answers.points.rows();
  Eigen::VectorXd step(d);
  for (std::size_t i = 0; i < candidates.targets.size(); ++i) {
    CheckInterruption(i);
    if (candidates.in_flats[i]) continue;
    for (Eigen::Index c = candidates.first[i]; c < candidates.first[i + 1]; ++c) {
      if (offsets_.size() >= 2 * static_cast<std::size_t>(d) * kMaxOffsets) return;
      if (!answers.found[static_cast<std::size_t>(c)]) continue;
      step = asked.col(c) - answers.points.col(c);
      const double* tangent = answers.tangents.col(c).data();
      double along2 = 0;
      for (int a = 0; a < K; ++a) {
        const double along = Dot(tangent + a * d, step.data(), static_cast<int>(d));
        along2 += along * along;
      }
      if (!HasTangentialOffset(std::sqrt(along2), step.norm())) continue;
      const Eigen::Map<const Eigen::MatrixXd> basis(tangent, d, K);
      step = basis * (basis.transpose() * step).eval();
      offsets_.insert(offsets_.end(), answers.points.col(c).begin(), answers.points.col(c).end());
      offsets_.insert(offsets_.end(), step.begin(), step.end());
    }
  }
}

std::string BoundaryDetector::Describe(int d) const {
  if (offsets_.empty()) return {};
  return Message(". Of the answers ", offsets_.size() / (2 * static_cast<std::size_t>(d)),
                 " did not lie straight below what was asked, the first ",
                 NamePoint(Eigen::Map<const Eigen::VectorXd>(offsets_.data(), d)),
                 ": the manifold ends there, or the tangent spaces are wrong");
}

#define STELLATE_EACH(K)                                                                  \
  template void BoundaryDetector::Look<K>(const CandidateSet<K>&, const Eigen::MatrixXd&, \
                                          const AnsweredPoints&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
