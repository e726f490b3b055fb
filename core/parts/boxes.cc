#include "core/parts/boxes.h"

#include <algorithm>
#include <numeric>

namespace stellate::core {

Boxes::Boxes(std::span<const double> points, int d, int parts) : d_(d) {
  std::vector<std::uint32_t> ids(points.size() / static_cast<std::size_t>(d));
  std::iota(ids.begin(), ids.end(), 0u);
  CutUp(points, ids, 0, parts);
}

// Cuts the box of those points into one a part, across its longest side. Returns the cut's number.
std::uint32_t Boxes::CutUp(std::span<const double> points, std::span<std::uint32_t> ids, int part,
                           int parts) {
  const auto number = static_cast<std::uint32_t>(cuts_.size());
  cuts_.emplace_back();
  if (parts == 1) {
    cuts_[number].below = static_cast<std::uint32_t>(part);
    return number;
  }
  const auto coordinate = [&](std::uint32_t id, int axis) {
    return points[id * static_cast<std::size_t>(d_) + static_cast<std::size_t>(axis)];
  };
  int longest = 0;
  double most = -1;
  for (int axis = 0; axis < d_ && !ids.empty(); ++axis) {
    const auto [low, high] = std::minmax_element(ids.begin(), ids.end(), [&](auto a, auto b) {
      return coordinate(a, axis) < coordinate(b, axis);
    });
    const double length = coordinate(*high, axis) - coordinate(*low, axis);
    if (!(length > most)) continue;
    most = length;
    longest = axis;
  }
  const int below = parts / 2;
  const std::size_t middle =
      ids.size() * static_cast<std::size_t>(below) / static_cast<std::size_t>(parts);
  // Of equal coordinates the lower id comes first: the same on every machine.
  std::nth_element(ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(middle), ids.end(),
                   [&](auto a, auto b) {
                     const double x = coordinate(a, longest), y = coordinate(b, longest);
                     return x != y ? x < y : a < b;
                   });
  Cut cut{longest, ids.empty() ? 0 : coordinate(ids[middle], longest), 0, 0};
  cut.below = CutUp(points, ids.first(middle), part, below);
  cut.above = CutUp(points, ids.subspan(middle), part + below, parts - below);
  cuts_[number] = cut;
  return number;
}

int Boxes::OwnerOf(const double* point) const {
  const Cut* cut = cuts_.data();
  while (cut->axis >= 0)
    cut = cuts_.data() + (point[cut->axis] < cut->at ? cut->below : cut->above);
  return static_cast<int>(cut->below);
}

// From a point, along each axis.
struct Boxes::Reached {
  const double* point;
  std::vector<double> off2;  // how far the boxes here are from it, squared
  FunctionRef<void(int)> visit;
};

// left2: what is left of the halo, squared. Two cuts across one axis do not add up: the farther one
// tells.
void Boxes::Walk(std::uint32_t number, double left2, Reached* from) const {
  const Cut& cut = cuts_[number];
  if (cut.axis < 0) return from->visit(static_cast<int>(cut.below));
  const double off = from->point[cut.axis] - cut.at;
  Walk(off < 0 ? cut.below : cut.above, left2, from);
  double& off2 = from->off2[static_cast<std::size_t>(cut.axis)];
  const double before = off2, beyond = std::max(before, off * off);
  if (beyond - before > left2) return;
  off2 = beyond;
  Walk(off < 0 ? cut.above : cut.below, left2 - (beyond - before), from);
  off2 = before;
}

void Boxes::ForEachNear(const double* point, double halo, FunctionRef<void(int)> visit) const {
  Reached from{point, std::vector<double>(static_cast<std::size_t>(d_)), visit};
  // Rounding shows a point to a part too many, never to one too few.
  Walk(0, halo * halo * (1 + 1e-9), &from);
}

}  // namespace stellate::core
