#pragma once

#include "core/base/instantiate.h"
#include "core/refinement/candidate_set.h"
#include "core/refinement/engine_parts.h"

namespace stellate::core {

// Chooses the points with which the faces of a stage begin.
template <int K>
class FaceSeeds {
 public:
  explicit FaceSeeds(const EngineParts<K>& engine) : engine_(engine) {}

  // Returns points of the faces of this stage that are far from the sample, when no targets are
  // left. Query and append them.
  PlannedPoints Choose();
  // Returns the known interior points that wait to be seeds, with their tangents.
  AnsweredPoints OfInterior() const;
  // Returns points near faces that were discovered since the last call. Query them together with
  // the targets.
  PlannedPoints TakeDiscoveries();

 private:
  EngineParts<K> engine_;
};

STELLATE_DECLARE_CLASS(FaceSeeds)

}  // namespace stellate::core
