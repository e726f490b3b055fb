#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"
#include "core/refinement/criteria.h"

namespace stellate::core {

// The bound of rule R1 at each star: epsilon, or less where the size is graded
// (Criteria::size_rate, max_deviation). A graded bound follows a local size of each vertex: the
// client's, or an estimate of the local feature size from the sample. The curvature of the boundary
// within M counts like M's.
//
//   sizes.Look(complex, changed_stars);      // after each round
//   if (sizes.NeedsSpreading(complex, false)) sizes.Spread(complex);
//   sizes.BoundAt(complex, star);
//
// Sizes are by star; all are lengths.
template <int K>
class SizeField {
 public:
  explicit SizeField(const ResolvedCriteria& criteria);

  bool is_estimated() const { return is_graded_ && !is_given_; }

  // Appends the client's size at the next vertex.
  void AppendGiven(double size) { given_.push_back(size); }
  // The client's sizes by vertex, or nullptr.
  const double* given() const { return is_given_ ? given_.data() : nullptr; }

  // Estimates the sizes at the stars `ids`, which are new or changed.
  void Look(const Stars<K>& stars, const std::vector<std::uint32_t>& ids);
  // Makes the estimates 1-Lipschitz over all stars.
  void Spread(const Stars<K>& stars);
  // Whether to call Spread: if the sample has grown much since the last call, or, if there is
  // nothing else to do, if it has changed at all.
  bool NeedsSpreading(const Stars<K>& stars, bool nothing_else_to_do) const;

  // The largest circumradius that R1 allows at a star. Estimates ask for no point in a protecting
  // ball, into which none is inserted.
  double BoundAt(const Stars<K>& stars, std::uint32_t star) const;
  // The same where the local size is `size`.
  double BoundFor(double size) const;
  // The least bound anywhere.
  double FinestBound() const;

  // The largest ratio of a star's circumradius to the local feature size estimated there, even
  // where the client gives sizes, since those need not be local feature sizes.
  double MaxRadiusOverSize(const Stars<K>& stars, bool boundary_only = false);
  // Counts vertices whose given size asks for a bound below the finest.
  std::uint64_t CountTooFine() const;

 private:
  double SeenFrom(const Stars<K>& stars, std::uint32_t star) const;
  double Estimate(const Stars<K>& stars, std::uint32_t star) const;
  double WantedFor(double size) const;

  double epsilon_, size_rate_, max_deviation_;
  bool is_graded_, is_given_;
  std::vector<double> given_;
  std::vector<double> seen_;       // the local feature size seen from the star
  std::vector<double> spread_;     // the same, 1-Lipschitz over the stars, when last spread
  std::uint32_t spread_over_ = 0;  // stars then
  bool is_spread_ = false;         // no estimate has changed since
};

STELLATE_DECLARE_CLASS(SizeField)

}  // namespace stellate::core
