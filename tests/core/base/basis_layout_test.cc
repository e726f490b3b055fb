#include "core/base/basis_layout.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace stellate::core {
namespace {

TEST(BasisLayout, IsNamedByWhatRunsSlowest) {
  const std::vector<double> by_vector = {1, 2, 3, 10, 20, 30};  // (1, 2, 3) and (10, 20, 30)
  std::vector<double> by_coordinate(6);
  ToByCoordinate(by_vector.data(), 3, 2, by_coordinate.data());
  EXPECT_EQ(by_coordinate, (std::vector<double>{1, 10, 2, 20, 3, 30}));
}

TEST(BasisLayout, IsTheSameAfterThereAndBack) {
  for (int d = 2; d <= 7; ++d) {
    for (int k = 1; k < d; ++k) {
      std::vector<double> basis(static_cast<std::size_t>(d * k));
      std::iota(basis.begin(), basis.end(), 1);
      std::vector<double> other(basis.size()), back(basis.size());
      ToByCoordinate(basis.data(), d, k, other.data());
      ToByVector(other.data(), d, k, back.data());
      EXPECT_EQ(back, basis) << "d " << d << " k " << k;
    }
  }
}

}  // namespace
}  // namespace stellate::core
