#include "core/certificate/evidence/ball_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace stellate::core {

BallGrid::BallGrid(int d, const double* centres, std::vector<double> radii)
    : d_(d), centres_(centres), radii_(std::move(radii)) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const double widest = radii_.empty() ? 0 : *std::max_element(radii_.begin(), radii_.end());
  std::vector<Axis> spread;
  std::vector<double> lengths;
  for (int c = 0; c < d; ++c) {
    double lower = kFar, upper = -kFar;
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      const double x = centres[i * static_cast<std::size_t>(d) + static_cast<std::size_t>(c)];
      lower = std::min(lower, x);
      upper = std::max(upper, x);
    }
    // Wider than the balls by more than rounding.
    const double margin = 1.01 * widest;
    spread.push_back({c, lower - margin, 0, 1});
    lengths.push_back(upper - lower + 2 * margin);
  }
  std::vector<int> order(static_cast<std::size_t>(d));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return lengths[a] > lengths[b]; });
  order.resize(static_cast<std::size_t>(std::min(d, kMaxAxes)));
  const auto fit = [&order](int cells) {
    double all = 1;
    for (std::size_t axis = 0; axis < order.size(); ++axis) all *= cells;
    return all <= kMaxCells;
  };
  int most = 1;
  while (!order.empty() && fit(most + 1)) ++most;
  std::size_t cells = 1;
  for (const int c : order) {
    Axis axis = spread[static_cast<std::size_t>(c)];
    const double length = lengths[static_cast<std::size_t>(c)];
    if (!(length > 0) || !std::isfinite(length)) continue;
    axis.cells = static_cast<int>(std::clamp(length / widest, 1.0, static_cast<double>(most)));
    axis.cells_per_length = axis.cells / length;
    if (!std::isfinite(axis.cells_per_length)) continue;
    cells *= static_cast<std::size_t>(axis.cells);
    axes_.push_back(axis);
  }

  begin_.assign(cells + 1, 0);
  for (std::size_t i = 0; i < radii_.size(); ++i)
    ForEachCellOf(i, [&](std::size_t cell) { ++begin_[cell + 1]; });
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  balls_.resize(begin_.back());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t i = 0; i < radii_.size(); ++i)
    ForEachCellOf(i,
                  [&](std::size_t cell) { balls_[next[cell]++] = static_cast<std::uint32_t>(i); });
}

template <typename Visit>
void BallGrid::ForEachCellOf(std::size_t ball, const Visit& visit) const {
  std::array<int, kMaxAxes> first{}, last{}, at{};
  for (std::size_t n = 0; n < axes_.size(); ++n) {
    const Axis& axis = axes_[n];
    const double x =
        centres_[ball * static_cast<std::size_t>(d_) + static_cast<std::size_t>(axis.coordinate)];
    const auto cell = [&](double coordinate) {
      const double place = (coordinate - axis.lower) * axis.cells_per_length;
      return static_cast<int>(std::clamp(place, 0.0, axis.cells - 1.0));
    };
    const double reach = 1.01 * radii_[ball];  // by more than rounding
    first[n] = at[n] = cell(x - reach);
    last[n] = cell(x + reach);
  }
  std::size_t a = 0;
  do {
    std::size_t number = 0;
    for (a = 0; a < axes_.size(); ++a)
      number = number * static_cast<std::size_t>(axes_[a].cells) + static_cast<std::size_t>(at[a]);
    visit(number);
    // The next place, as an odometer counts.
    for (a = 0; a < axes_.size() && at[a]++ == last[a]; ++a) at[a] = first[a];
  } while (a < axes_.size());
}

}  // namespace stellate::core
