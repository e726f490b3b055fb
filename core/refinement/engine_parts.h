#pragma once

#include <cstdint>

#include "core/complex/stars.h"
#include "core/refinement/boundary_state.h"
#include "core/refinement/criteria.h"
#include "core/refinement/size_field.h"
#include "core/refinement/violation_index.h"

namespace stellate::core {

// The parts of an engine that its helpers for one step of a round work on. Borrowed: they must
// outlive the helper.
template <int K>
struct EngineParts {
  Stars<K>& stars;
  SizeField<K>& sizes;
  ViolationIndex<K>& violations;
  const ResolvedCriteria& criteria;
  BoundaryState<K>& boundary;
  std::uint64_t max_vertices;

  bool is_full() const { return stars.size() >= max_vertices; }
};

}  // namespace stellate::core
