#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/cavities.h"
#include "core/refinement/criteria.h"

namespace stellate::core {

// The mesh whose cavities, where a few stars disagree, are filled by tilings
// (core/complex/cavities.h). HandOut replaces the union of the stars by it.
template <int K>
class FilledMesh {
 public:
  // Fills the cavities of the complex, for k >= 4, and forgets earlier fillings.
  void Fill(const Stars<K>& stars, const ResolvedCriteria& criteria);
  void Clear() { cavities_ = {}; }

  // Whether the filling leaves the violating simplex out of the mesh.
  bool Resolves(const Stars<K>& stars, std::uint32_t star, const Violation<K>& violation) const;

  // The stars whose violations of R3 and R4 the filling resolves, until they are tested again.
  const std::vector<std::uint32_t>& resolved() const { return resolved_; }
  void NoteResolved(std::uint32_t star) { resolved_.push_back(star); }
  void ForgetResolved() { resolved_.clear(); }

  // Makes this the mesh. `added` and `removed`, K+1 ids each, come in as a round's change of the
  // union of the stars, and go out as its change of the mesh.
  void HandOut(const Stars<K>& stars, std::vector<std::uint32_t>* added,
               std::vector<std::uint32_t>* removed);
  bool is_handed_out() const { return is_handed_out_; }

  const FilledCavities& cavities() const { return cavities_; }

 private:
  FilledCavities cavities_;
  std::vector<std::uint32_t> resolved_;
  bool is_handed_out_ = false;
};

STELLATE_DECLARE_CLASS(FilledMesh)

}  // namespace stellate::core
