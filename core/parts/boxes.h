#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/function_ref.h"

namespace stellate::core {

// R^d cut into boxes, one a part: what lies in a part's box is its own. All parts make the same
// boxes from the same sample.
//
//   const Boxes boxes(sample, d, 4);
//   const int owner = boxes.OwnerOf(point);
//   boxes.ForEachNear(point, halo, [&](int part) { near.push_back(part); });
class Boxes {
 public:
  // All of space, in one box.
  Boxes() : cuts_(1) {}
  // Boxes that hold about equally many of the points, d numbers each: a coarse sample is enough. If
  // there are fewer points than parts, some boxes hold none. REQUIRES: all are finite
  Boxes(std::span<const double> points, int d, int parts);

  int parts() const { return static_cast<int>(cuts_.size() + 1) / 2; }
  // Returns the part whose box the point, d coordinates, lies in: always exactly one.
  int OwnerOf(const double* point) const;
  // Calls visit(part) once for each part whose box is no farther from the point than `halo`, a
  // length: the box it lies in, and others.
  void ForEachNear(const double* point, double halo, FunctionRef<void(int)> visit) const;

 private:
  // Where a coordinate is less, what lies there is in `below`, else in `above`: other cuts. If
  // there is no axis: in a box, of the part `below`.
  struct Cut {
    int axis = -1;
    double at = 0;
    std::uint32_t below = 0, above = 0;
  };
  struct Reached;
  std::uint32_t CutUp(std::span<const double> points, std::span<std::uint32_t> ids, int part,
                      int parts);
  void Walk(std::uint32_t cut, double left2, Reached* from) const;

  int d_ = 0;
  std::vector<Cut> cuts_;
};

}  // namespace stellate::core
