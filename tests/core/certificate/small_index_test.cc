#include "core/certificate/complex/small_index.h"

#include <gtest/gtest.h>

#include <map>

#include "core/base/random.h"

namespace stellate::core {
namespace {

TEST(SmallIndex, NumbersIdsAsTheyComeHoweverManyWereExpected) {
  SmallIndex index;
  Random random(7);
  for (const std::size_t expected : {0, 1, 6, 40, 5}) {
    index.Clear(expected);
    std::map<std::uint32_t, std::uint32_t> numbers;
    for (int n = 0; n < 300; ++n) {
      const auto id = static_cast<std::uint32_t>(random.Next() % 100) * 0x10001;
      const auto [place, fresh] = numbers.try_emplace(id, index.size());
      EXPECT_EQ(index.Number(id), place->second);
      EXPECT_EQ(index.size(), numbers.size());
    }
  }
}

}  // namespace
}  // namespace stellate::core
