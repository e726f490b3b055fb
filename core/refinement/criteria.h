#pragma once

#include <cmath>

#include "core/rules/r3_slivers.h"
#include "core/specification.h"

namespace stellate::core {

// The constants of a run, with the defaults for this k:
//
//   const ResolvedCriteria criteria = Resolve(spec);
struct ResolvedCriteria {
  double epsilon, radius_edge_bound, picking_radius, small_sliver_radius, advance_step;
  double inradius;  // of the fake simplex that a cell begins with, length
  ShapeBounds shape;
  int candidates, flat_alternations;
  bool speculative;
  CentreRule centre_rule;
  double size_rate, max_deviation;  // infinity: no such criterion
  bool sizes_given;                 // graded by the client's sizes
  bool graded() const { return std::isfinite(size_rate) || std::isfinite(max_deviation); }
};

ResolvedCriteria Resolve(const Specification& spec);

}  // namespace stellate::core
