#include "core/certificate/findings.h"

#include <algorithm>

#include "core/base/message.h"

namespace stellate::core {

std::string TooCoarse(double ratio, double reach, const std::string& where) {
  return Message(
      "the mesh size is ", Brief(ratio), " times the estimated reach ", Brief(reach),
      where.empty() ? "" : ", which was seen ", where,
      ": the manifold bends that sharply, or comes so near to itself, there; take epsilon "
      "at most ",
      Brief(0.4 * reach));
}

void Findings::Refuse(Subject subject, std::string problem) {
  const auto place = std::lower_bound(problems_.begin(), problems_.end(), subject,
                                      [](const Problem& p, Subject s) { return p.subject < s; });
  if (place != problems_.end() && place->subject == subject) return;
  problems_.insert(place, {subject, std::move(problem)});
}

std::string NamePoint(const Eigen::VectorXd& x) {
  std::string name = "(";
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(x.size(), 6); ++i) {
    name += Message(i > 0 ? ", " : "", Brief(x[i]));
  }
  return name + (x.size() > 6 ? ", ...)" : ")");
}

void Findings::Conclude(int k, const Specification& spec, Certificate& certificate) const {
  certificate.certified = clean();
  certificate.level = !clean()           ? CertificateLevel::kRefused
                      : theorem_.empty() ? CertificateLevel::kSampled
                                         : CertificateLevel::kProved;
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
  const std::string what =
      Message("a closed ", certificate.orientable ? "orientable" : "non-orientable",
              " manifold of dimension ", k, " with ", components,
              components == 1 ? " component" : " components", " and Euler characteristic ",
              certificate.euler_characteristic);
  const char* const unseen =
      "Components of the manifold that no seed or sampled point fell on cannot be excluded";
  const char* const declared = components == static_cast<std::uint64_t>(spec.components)
                                   ? ", but as many were declared."
                                   : ".";
  if (!theorem_.empty()) {
    certificate.verdict = Message("Proved: ", theorem_, ". It is ", what,
                                  ". Assumed, beside the reach: that the oracle's answers are "
                                  "exact, and that the manifold has "
                                  "no boundary.");
    if (!covered_) certificate.verdict += Message(" ", unseen, declared);
    return;
  }
  certificate.verdict = Message(
      "Certified: ", what,
      ". Decided on the whole mesh: it is closed, and each star embeds in the tangent space of its "
      "centre. Sampled: ",
      certificate.fibre_samples, " normal flats meet the mesh once, ",
      spec.audit == Audit::kThorough ? "balls at every vertex and simplex"
                                     : "balls at some vertices",
      " show no reach below ", Brief(certificate.estimated_reach), ", and all of ",
      certificate.answers_held,
      " answers that are no vertices lie on the mesh. Assumed: that the manifold has no boundary, "
      "and "
      "no part narrower than epsilon that no question came near. ",
      unseen, declared);
}

}  // namespace stellate::core
