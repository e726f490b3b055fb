#include "core/certificate/findings.h"

#include <algorithm>

#include "core/message.h"

namespace stellate::core {

std::string CoarsenessWarning(double epsilon, double reach) {
  if (!(epsilon > kCoarse * reach)) return {};
  return Message("epsilon is ", Brief(epsilon / reach), " times the estimated reach ", Brief(reach),
                 ": too coarse to trust the mesh's topology; take epsilon at most ",
                 Brief(0.4 * reach), ".");
}

void Findings::Refuse(Subject subject, std::string problem) {
  const auto place = std::lower_bound(problems_.begin(), problems_.end(), subject,
                                      [](const Problem& p, Subject s) { return p.subject < s; });
  if (place != problems_.end() && place->subject == subject) return;
  problems_.insert(place, {subject, std::move(problem)});
}

void Findings::Conclude(int k, Certificate& certificate) const {
  certificate.certified = clean();
  certificate.warnings = warnings_;
  if (!clean()) {
    certificate.verdict = Message("Not certified: ", problems_.front().text, ".");
    if (problems_.size() > 1) {
      certificate.verdict += Message(" Other checks failed too (", problems_.size() - 1,
                                     "), next: ", problems_[1].text, ".");
    }
    return;
  }
  const std::uint64_t components = certificate.components;
  certificate.verdict = Message(
      "Certified: a closed ", certificate.orientable ? "orientable" : "non-orientable",
      " manifold of dimension ", k, " with ", components,
      components == 1 ? " component" : " components", " and Euler characteristic ",
      certificate.euler_characteristic,
      "; each star embeds in the tangent space of its centre and ", certificate.fibre_samples,
      " sampled normal flats meet the mesh once. Components of the manifold that no seed or "
      "sampled "
      "point fell on cannot be excluded.");
}

}  // namespace stellate::core
