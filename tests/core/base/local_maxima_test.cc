#include "core/base/local_maxima.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/random.h"

namespace stellate::core {
namespace {

// What the walk in order of strength chooses: here lower numbers are stronger.
std::vector<std::uint8_t> Walk(const std::vector<std::vector<std::size_t>>& stronger) {
  std::vector<std::uint8_t> chosen(stronger.size());
  for (std::size_t i = 0; i < stronger.size(); ++i)
    chosen[i] = std::none_of(stronger[i].begin(), stronger[i].end(),
                             [&](std::size_t j) { return chosen[j] != 0; });
  return chosen;
}

std::vector<std::uint8_t> Passes(const std::vector<std::vector<std::size_t>>& stronger) {
  return ChooseLocalMaxima(stronger.size(), [&](std::size_t i, const auto& visit) {
    for (const std::size_t j : stronger[i])
      if (!visit(j)) return;
  });
}

TEST(LocalMaxima, ChooseWhatTheWalkInOrderDoes) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Random random(seed);
    std::vector<std::vector<std::size_t>> stronger(300);
    for (std::size_t i = 1; i < stronger.size(); ++i)
      for (std::uint64_t n = random.Next() % 5; n > 0; --n)
        stronger[i].push_back(static_cast<std::size_t>(random.Next() % i));
    EXPECT_EQ(Passes(stronger), Walk(stronger)) << seed;
  }
}

// Each waits for the next one, or for the one before.
TEST(LocalMaxima, FollowLongChains) {
  constexpr std::size_t kCount = 100'000;
  std::vector<std::vector<std::size_t>> up(kCount), down(kCount);
  for (std::size_t i = 1; i < kCount; ++i) up[i] = {i - 1};
  for (std::size_t i = 0; i + 1 < kCount; ++i) down[i] = {i + 1};
  const std::vector<std::uint8_t> first = Passes(up), last = Passes(down);
  for (std::size_t i = 0; i < kCount; ++i) {
    ASSERT_EQ(first[i], i % 2 == 0) << i;
    ASSERT_EQ(last[i], (kCount - 1 - i) % 2 == 0) << i;
  }
  EXPECT_TRUE(Passes({}).empty());
}

}  // namespace
}  // namespace stellate::core
