#include "core/base/room.h"

#include <gtest/gtest.h>

namespace stellate::core {
namespace {

TEST(LeaveRoom, KeepsWhatIsThereAndALittleMore) {
  std::vector<int> numbers;
  for (int i = 0; i < 1025; ++i) numbers.push_back(i);  // room for 2048, where it doubles
  const std::vector<int> before = numbers;
  LeaveRoom(8, &numbers);
  EXPECT_EQ(numbers, before);
  EXPECT_GE(numbers.capacity(), 1025u + 128u);
  EXPECT_LT(numbers.capacity(), 1200u);
  std::vector<int> none;
  LeaveRoom(8, &none);
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace stellate::core
