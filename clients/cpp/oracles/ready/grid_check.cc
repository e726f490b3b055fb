#include "oracles/ready/grid_check.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "oracles/combined/common.h"

namespace stellate::oracles {
namespace {

// Of the places where a level is passed: no more may lie between equal values, or between numbers
// next to each other.
constexpr double kFlatShare = 0.5;
// With fewer such places symmetric values, too, are mostly next to each other.
constexpr std::size_t kFewSteps = 300;
constexpr std::ptrdiff_t kOpen = 3;  // cells that an open border goes on for

// The place of a value along each axis, and the next one. The last axis changes fastest.
class Count {
 public:
  explicit Count(const std::vector<int>& shape) : shape_(shape), at_(shape.size()) {}
  std::ptrdiff_t operator[](std::size_t axis) const { return at_[axis]; }
  bool OnBorder() const {
    for (std::size_t a = 0; a < at_.size(); ++a) {
      if (at_[a] == 0 || at_[a] + 1 == shape_[a]) return true;
    }
    return false;
  }
  void Next() {
    for (std::size_t a = at_.size(); a-- > 0;) {
      if (++at_[a] < shape_[a]) return;
      at_[a] = 0;
    }
  }

 private:
  const std::vector<int>& shape_;
  std::vector<std::ptrdiff_t> at_;
};

std::vector<std::ptrdiff_t> Strides(const std::vector<int>& shape) {
  std::vector<std::ptrdiff_t> strides(shape.size(), 1);
  for (std::size_t a = shape.size(); a-- > 1;) strides[a - 1] = strides[a] * shape[a];
  return strides;
}

// Of the steps along the axes where the level is passed, those between values that do not change.
double FlatShare(const GridValues& grid, double level) {
  const std::vector<std::ptrdiff_t> strides = Strides(grid.shape);
  double steps = 0, flat = 0;
  Count at(grid.shape);
  for (Eigen::Index i = 0; i < grid.values.size(); ++i, at.Next()) {
    for (std::size_t a = 0; a < strides.size(); ++a) {
      if (at[a] < 1 || at[a] + 2 >= grid.shape[a]) continue;
      const auto value = [&](std::ptrdiff_t off) { return grid.values[i + off * strides[a]]; };
      if ((value(0) > level) == (value(1) > level)) continue;
      ++steps;
      if (value(-1) == value(0) && value(1) == value(2)) ++flat;
    }
  }
  return steps > 0 ? flat / steps : 0;
}

// Of the same steps, those between two of the numbers there with none in between.
double RoundedShare(const GridValues& grid, double level) {
  const std::vector<std::ptrdiff_t> strides = Strides(grid.shape);
  std::vector<std::pair<double, double>> steps;
  Count at(grid.shape);
  for (Eigen::Index i = 0; i < grid.values.size(); ++i, at.Next()) {
    for (std::size_t a = 0; a < strides.size(); ++a) {
      if (at[a] < 1 || at[a] + 2 >= grid.shape[a]) continue;
      const double one = grid.values[i], other = grid.values[i + strides[a]];
      if ((one > level) != (other > level)) steps.push_back(std::minmax({one, other}));
    }
  }
  if (steps.size() < kFewSteps) return 0;
  std::vector<double> numbers;
  for (const auto& [lower, upper] : steps) numbers.insert(numbers.end(), {lower, upper});
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  const auto is_next = [&](const auto& step) {
    return *std::upper_bound(numbers.begin(), numbers.end(), step.first) == step.second;
  };
  return static_cast<double>(std::count_if(steps.begin(), steps.end(), is_next)) /
         static_cast<double>(steps.size());
}

[[noreturn]] void RefuseToLeave(const GridValues& grid, const Count& at, double level) {
  std::string place;
  for (std::size_t a = 0; a < grid.shape.size(); ++a) {
    const auto axis = static_cast<Eigen::Index>(a);
    const double side = grid.box.upper[axis] - grid.box.lower[axis];
    const double share = static_cast<double>(at[a]) / (grid.shape[a] - 1);
    place += (a > 0 ? ", " : "") + Short(grid.box.lower[axis] + share * side);
  }
  Refuse("the surface of level " + Short(level) + " leaves the grid through its border, near (" +
         place +
         "): it has an end there, and no smooth manifold does. Clip it to the grid: "
         "SignedDistance::OfGrid(values, shape, box, level, GridBorder::kOpen) in a Clipped with "
         "the "
         "box. Or, where it closes soon beyond, pad the values by more of what is outside");
}

}  // namespace

double InsistOnASurface(const GridValues& grid, double level, bool open_border) {
  const double low = grid.values.minCoeff(), high = grid.values.maxCoeff();
  if (!(low < level && level < high)) {
    Refuse("no set of level " + Short(level) + ": the values lie between " + Short(low) + " and " +
           Short(high) +
           (low < high ? "; give a level between them, such as " + Short((low + high) / 2) : ""));
  }
  if (FlatShare(grid, level) > kFlatShare) {
    Refuse("values are all but constant on both sides of the level " + Short(level) +
           ", as labels and masks are: the surface between them is stairs, and no smooth one. "
           "Smooth them, by a Gaussian of some 1.5 spacings, or take distances to their surface");
  }
  if (RoundedShare(grid, level) > kFlatShare) {
    Refuse("values are rounded too coarsely: where they pass the level " + Short(level) +
           ", most go from one of the numbers that they take to the next one, and the surface "
           "between them is terraced, as no smooth one is. Take them as they were before, or "
           "smooth them, by a Gaussian of some 1.5 spacings");
  }
  const bool side = grid.values[0] > level;
  Count at(grid.shape);
  for (Eigen::Index i = 0; i < grid.values.size() && !open_border; ++i, at.Next()) {
    if ((grid.values[i] > level) != side && at.OnBorder()) RefuseToLeave(grid, at, level);
  }
  return side ? 1 : -1;
}

WiderGrid GoneOnStraight(const GridValues& grid) {
  WiderGrid wider{grid.values, grid.shape, grid.box};
  for (std::size_t a = 0; a < grid.shape.size(); ++a) {
    // Lines along the axis, each of `count` values `stride` apart.
    const std::vector<std::ptrdiff_t> strides = Strides(wider.shape);
    const std::ptrdiff_t count = wider.shape[a], stride = strides[a], longer = count + 2 * kOpen;
    const std::ptrdiff_t lines = wider.values.size() / count;
    Eigen::VectorXd values(lines * longer);
    for (std::ptrdiff_t line = 0; line < lines; ++line) {
      const std::ptrdiff_t outer = line / stride, inner = line % stride;
      const auto old = [&](std::ptrdiff_t i) {
        return wider.values[(outer * count + i) * stride + inner];
      };
      for (std::ptrdiff_t i = 0; i < longer; ++i) {
        const std::ptrdiff_t at = i - kOpen, last = count - 1;
        const double value = at < 0      ? 2 * old(0) - old(-at)
                             : at > last ? 2 * old(last) - old(2 * last - at)
                                         : old(at);
        values[(outer * longer + i) * stride + inner] = value;
      }
    }
    const auto axis = static_cast<Eigen::Index>(a);
    const double spacing =
        (grid.box.upper[axis] - grid.box.lower[axis]) / static_cast<double>(count - 1);
    wider.values = std::move(values);
    wider.shape[a] = static_cast<int>(longer);
    wider.box.lower[axis] -= static_cast<double>(kOpen) * spacing;
    wider.box.upper[axis] += static_cast<double>(kOpen) * spacing;
  }
  return wider;
}

}  // namespace stellate::oracles
