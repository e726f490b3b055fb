#pragma once

#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/closed_off.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// The claim that an arrangement of walls falls into its regions: each region is a manifold with
// boundary that ends where its label does and nowhere else, and each simplex has the label of the
// part of M that it lies in. Together with the union of all, which BoundaryClaims judge, the
// regions fill M without gap or overlap.
class RegionClaims {
 public:
  explicit RegionClaims(Examination& examination) : x_(examination) {}

  // Fills the certificate's report of each region, and checks that it is a manifold with boundary.
  void Judge();

  // Checks labels by answers inside simplices. `chosen`, `each`: see PointsInside.
  void JudgeInside(const std::vector<std::uint32_t>& chosen, std::uint32_t each,
                   const AnswerBlock& answer);

 private:
  void JudgeRegion(int label, const std::vector<std::uint32_t>& simplices);
  std::vector<std::int64_t> BettiNumbersOf(const RegionReport& report,
                                           const std::vector<std::uint32_t>& simplices,
                                           const ClosedOff& closed_off) const;

  Examination& x_;
};

}  // namespace stellate::core
