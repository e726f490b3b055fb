#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/cavities.h"
#include "core/refinement/criteria.h"

namespace stellate::core {

// The mesh where the stars disagree about a few simplices and the cavities that these leave were
// tiled instead (core/complex/cavities.h). It stands beside the union of the stars until HandOut,
// which puts it in its place.
template <int K>
class FilledMesh {
 public:
  // Fills the cavities of the complex as it is, for those k where that is done; forgets all that
  // was filled before.
  void Fill(const StarComplex<K>& complex, const ResolvedCriteria& criteria);
  void Clear() { cavities_ = {}; }

  // Whether the violating simplex is not in the mesh anyway, because its cavity is filled without
  // it.
  bool Mends(const StarComplex<K>& complex, std::uint32_t star,
             const Violation<K>& violation) const;

  // The stars whose violations of R3 and R4 it mends, kept here until they are judged again.
  const std::vector<std::uint32_t>& mended() const { return mended_; }
  void NoteMended(std::uint32_t star) { mended_.push_back(star); }
  void ForgetMended() { mended_.clear(); }

  // From here on this is the mesh. `added` and `removed`, K+1 ids each, say what a round changed in
  // the union of the stars, and now what it changes in the mesh.
  void HandOut(const StarComplex<K>& complex, std::vector<std::uint32_t>* added,
               std::vector<std::uint32_t>* removed);
  bool is_handed_out() const { return is_handed_out_; }

  const FilledCavities& cavities() const { return cavities_; }

 private:
  FilledCavities cavities_;
  std::vector<std::uint32_t> mended_;
  bool is_handed_out_ = false;
};

STELLATE_DECLARE_CLASS(FilledMesh)

}  // namespace stellate::core
