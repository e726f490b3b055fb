#include "core/parts/share_out.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/core/support/thread_peers.h"

namespace stellate::core {
namespace {

using testing::ThreadPeers;

TEST(ShareOut, HasEachThingDoneOnceAndToldToAll) {
  for (const int parts : {1, 2, 3, 8})
    for (const std::size_t count : {0u, 1u, 7u, 1000u}) {
      SCOPED_TRACE(std::to_string(parts) + " parts, " + std::to_string(count));
      std::vector<std::atomic<int>> times(count);
      ThreadPeers all(parts);
      all.Run([&](const Peers& peers) {
        std::vector<std::uint64_t> squares(count);
        ShareOut(peers, std::span(squares), 16, [&](std::size_t i) {
          ++times[i];
          squares[i] = i * i;
        });
        for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(squares[i], i * i);
      });
      for (const auto& time : times) EXPECT_EQ(time, 1);
    }
}

// What comes of a thing may be of any length.
TEST(ShareOut, TellsListsToo) {
  ThreadPeers all(3);
  all.Run([&](const Peers& peers) {
    std::vector<std::vector<std::uint32_t>> lists(100);
    ShareOut(
        peers, lists.size(), 7,
        [&](std::size_t i) { lists[i].assign(i, static_cast<std::uint32_t>(i)); },
        [&](std::size_t i, Peers::Bytes* message) { PackAll(lists[i], message); },
        [&](std::size_t i, Parcel* parcel) { parcel->UnpackAll(&lists[i]); });
    for (std::uint32_t i = 0; i < lists.size(); ++i)
      EXPECT_EQ(lists[i], std::vector<std::uint32_t>(i, i));
  });
}

// All parts have about as much to do.
TEST(ShareOut, DealsInTurn) {
  std::vector<std::size_t> done(4);
  ThreadPeers all(4);
  all.Run([&](const Peers& peers) {
    std::vector<int> results(1000);
    std::atomic<std::size_t> own = 0;
    ShareOut(peers, std::span(results), 16, [&](std::size_t) { ++own; });
    done[static_cast<std::size_t>(peers.part())] = own;
  });
  for (const std::size_t own : done) {
    EXPECT_GE(own, 240u);
    EXPECT_LE(own, 256u);
  }
}

}  // namespace
}  // namespace stellate::core
