#include "core/places.h"

namespace stellate::core {

const char* PlaceName(Place place) {
  switch (place) {
    case Place::kOk:
      return "OK";
    case Place::kMerged:
      return "MERGED";
    case Place::kDropped:
      return "DROPPED";
    case Place::kTiled:
      return "TILED";
    case Place::kWeighted:
      return "WEIGHTED";
    case Place::kEdge:
      return "EDGE";
    case Place::kSheets:
      return "SHEETS";
    case Place::kNoise:
      return "NOISE";
    case Place::kSparse:
      return "SPARSE";
    case Place::kClose:
      return "CLOSE";
    case Place::kDisagree:
      return "DISAGREE";
    case Place::kAdded:
      return "ADDED";
  }
  return "UNKNOWN";
}

const char* PlaceAdvice(Place place) {
  switch (place) {
    case Place::kOk:
      return "nothing to do";
    case Place::kMerged:
      return "the point equals an earlier one, which stands for both";
    case Place::kDropped:
      return "the point was left out: the others make a manifold, and with it they do not";
    case Place::kTiled:
      return "stars disagreed here, and a tiling of the place replaces them";
    case Place::kWeighted:
      return "the point has a weight, by which the stars agree";
    case Place::kEdge:
      return "the manifold ends here, or the points have a hole: allow a boundary, or add points";
    case Place::kSheets:
      return "another part of the manifold is as near as the neighbours are: add points there";
    case Place::kNoise:
      return "points are off a smooth manifold by half of the spacing or more: if by noise, "
             "average or thin them; if they are outliers, take them out; a crease or a corner "
             "stays "
             "in doubt, however many points there are";
    case Place::kSparse:
      return "the points are too few for how the manifold bends: about 2.3 times as many are "
             "needed "
             "here";
    case Place::kClose:
      return "two points are much nearer to each other than the spacing: thin the points, or allow "
             "to drop more of them";
    case Place::kDisagree:
      return "stars disagree here for no cause that was found: add points, or allow to drop more "
             "of them";
    case Place::kAdded:
      return "no point was here: this one was added, on the surface fitted to the others";
  }
  return "";
}

}  // namespace stellate::core
