#include "oracles/files/soup.h"

#include <algorithm>
#include <limits>

#include "oracles/combined/common.h"

namespace stellate::oracles::files {

void Soup::AddPolygon(const std::vector<std::int64_t>& corners, size_t place) {
  if (corners.empty()) return;
  const auto [least, most] = std::minmax_element(corners.begin(), corners.end());
  if (*least < 0) {
    Refuse(places_ + " " + std::to_string(place) + ": a polygon names point " +
           std::to_string(*least));
  }
  if (*most > largest_) {
    largest_ = *most;
    largest_place_ = place;
  }
  // Finish refuses what does not fit here.
  const auto name = [](std::int64_t corner) {
    return static_cast<int>(std::min<std::int64_t>(corner, std::numeric_limits<int>::max()));
  };
  for (size_t i = 2; i < corners.size(); ++i) {
    corners_.insert(corners_.end(), {name(corners[0]), name(corners[i - 1]), name(corners[i])});
  }
}

Eigen::MatrixXd Soup::Points() const {
  return Eigen::Map<const Eigen::MatrixXd>(points_.data(), 3, size());
}

Triangles Soup::Finish() const {
  if (size() > std::numeric_limits<int>::max()) {
    Refuse("it has " + std::to_string(size()) + " points, and no more than 2,147,483,647 are read");
  }
  if (largest_ >= size()) {
    Refuse(places_ + " " + std::to_string(largest_place_) + ": a polygon names point " +
           std::to_string(largest_) + ", counted from 0, and there are " + std::to_string(size()) +
           " points: is the file whole?");
  }
  if (corners_.empty()) Refuse("it has no triangles");
  return {Points(),
          Eigen::Map<const Eigen::MatrixXi>(corners_.data(), 3, std::ssize(corners_) / 3)};
}

}  // namespace stellate::oracles::files
