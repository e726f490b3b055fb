#include "core/complex/blocks.h"

#include <gtest/gtest.h>

#include <vector>

namespace stellate::core {
namespace {

TEST(Blocks, KeepWhatTheyHoldInPlaceWhileTheyGrow) {
  Blocks<std::size_t> blocks;
  EXPECT_EQ(blocks.size(), 0u);
  std::vector<const std::size_t*> places;
  for (const std::size_t size : {1, 2, 1023, 1024, 1025, 5000}) {
    const std::size_t old = blocks.size();
    blocks.resize(size);
    ASSERT_EQ(blocks.size(), size);
    for (std::size_t i = old; i < size; ++i) {
      EXPECT_EQ(blocks[i], 0u);
      blocks[i] = i + 7;
      places.push_back(&blocks[i]);
    }
    for (std::size_t i = 0; i < size; ++i) {
      EXPECT_EQ(blocks[i], i + 7);
      EXPECT_EQ(&blocks[i], places[i]);
    }
  }
}

TEST(Blocks, AreCopiedWhole) {
  Blocks<std::vector<int>> blocks;
  blocks.resize(3000);
  for (int i = 0; i < 3000; ++i) blocks[static_cast<std::size_t>(i)].assign(3, i);
  Blocks<std::vector<int>> copy(blocks);
  copy[5][0] = -1;
  ASSERT_EQ(copy.size(), 3000u);
  for (std::size_t i = 6; i < 3000; ++i) EXPECT_EQ(copy[i], blocks[i]);
  EXPECT_EQ(blocks[5][0], 5);
}

}  // namespace
}  // namespace stellate::core
