#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/star_complex.h"
#include "core/refinement/criteria.h"

namespace stellate::core {

// How large the simplices of each star may be: epsilon, or less where the size is graded
// (Criteria::size_rate, max_deviation). Then the bound follows a local size of each vertex: what
// the client gives, or the local feature size that the sample shows.
//
// Sizes are by star; all lengths. At the boundary of M that counts too: its curvature within M is
// seen as M's is.
template <int K>
class SizeField {
 public:
  explicit SizeField(const ResolvedCriteria& criteria);

  bool is_estimated() const { return is_graded_ && !is_given_; }

  // What the client gives, of the next vertex.
  void AppendGiven(double size) { given_.push_back(size); }
  // By vertex, or nullptr where the client gives none.
  const double* given() const { return is_given_ ? given_.data() : nullptr; }

  // Estimates anew what is seen from `stars`, which are new or changed.
  void Look(const StarComplex<K>& complex, const std::vector<std::uint32_t>& stars);
  // Makes the estimates 1-Lipschitz over all stars.
  void Spread(const StarComplex<K>& complex);
  // Whether they should be spread: when the sample has grown much since that was last done, and,
  // if there is nothing else to do, when it has changed at all.
  bool NeedsSpreading(const StarComplex<K>& complex, bool nothing_else_to_do) const;

  // R1 of a star: its circumradii must not be larger.
  double BoundAt(const StarComplex<K>& complex, std::uint32_t star) const;
  // The same where the local size is `size`.
  double BoundFor(double size) const;
  // No bound is below.
  double FinestBound() const;

  // The largest circumradius of a star over the local feature size that the sample shows there,
  // even where sizes are given: those need not be local feature sizes.
  double MaxRadiusOverSize(const StarComplex<K>& complex);
  // Vertices whose given size asks for a bound below the finest.
  std::uint64_t CountTooFine() const;

 private:
  double SeenFrom(const StarComplex<K>& complex, std::uint32_t star) const;
  double Estimate(const StarComplex<K>& complex, std::uint32_t star) const;
  double WantedFor(double size) const;

  double epsilon_, size_rate_, max_deviation_;
  bool is_graded_, is_given_;
  std::vector<double> given_;
  std::vector<double> seen_;       // the local feature size seen from the star
  std::vector<double> spread_;     // the same, 1-Lipschitz over the stars, when last spread
  std::uint32_t spread_over_ = 0;  // stars then
  bool is_spread_ = false;         // nothing was seen anew since
};

STELLATE_DECLARE_CLASS(SizeField)

}  // namespace stellate::core
