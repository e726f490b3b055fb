#include "core/parts/numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/random.h"
#include "tests/core/support/thread_peers.h"

namespace stellate::core {
namespace {

// Things that are dealt out at random are numbered as if one part had them all.
TEST(NumbersOf, PartsAreTheirPlacesInTheWhole) {
  constexpr std::uint32_t kPatches = 7;
  Random random(1);
  std::vector<OrderKey> all;
  for (std::uint32_t i = 0; i < 500; ++i)
    all.push_back({static_cast<std::uint32_t>(random.Next() % kPatches), random.Next() % 20, i});
  std::sort(all.begin(), all.end());
  for (const int parts : {1, 2, 3, 5, 8, 20}) {
    std::vector<std::vector<OrderKey>> keys(static_cast<std::size_t>(parts));
    std::vector<std::vector<std::uint32_t>> expected(keys.size()), numbers(keys.size());
    for (std::uint32_t i = 0; i < all.size(); ++i) {
      const std::uint64_t part = random.Next() % static_cast<std::uint64_t>(parts);
      keys[part].push_back(all[i]);
      expected[part].push_back(i);
    }
    testing::ThreadPeers(parts).Run([&](const Peers& peers) {
      const auto part = static_cast<std::size_t>(peers.part());
      numbers[part] = NumbersOf(peers, keys[part], kPatches);
    });
    EXPECT_EQ(numbers, expected) << parts;
  }
}

}  // namespace
}  // namespace stellate::core
