#include <gtest/gtest.h>

#include "core/base/capacity.h"

namespace stellate::core {
namespace {

TEST(FitCapacity, KeepsWhatIsThereAndALittleMore) {
  std::vector<int> numbers;
  for (int i = 0; i < 1025; ++i) numbers.push_back(i);  // room for 2048, where it doubles
  const std::vector<int> before = numbers;
  FitCapacity(8, &numbers);
  EXPECT_EQ(numbers, before);
  EXPECT_GE(numbers.capacity(), 1025u + 128u);
  EXPECT_LT(numbers.capacity(), 1200u);
  std::vector<int> none;
  FitCapacity(8, &none);
  EXPECT_TRUE(none.empty());
}

TEST(ReserveMore, MovesSeldomAndDoesNotDouble) {
  std::vector<int> numbers;
  int moves = 0;
  for (int i = 0; i < 100000; ++i) {
    const int* const before = numbers.data();
    ReserveMore(1, &numbers);
    numbers.push_back(i);
    moves += numbers.data() != before;
  }
  EXPECT_LT(moves, 150);
  EXPECT_LE(numbers.capacity(), numbers.size() + numbers.size() / 7);
  EXPECT_EQ(numbers[99999], 99999);
  ReserveMore(1000000, &numbers);
  EXPECT_GE(numbers.capacity(), numbers.size() + 1000000);
}

}  // namespace
}  // namespace stellate::core
