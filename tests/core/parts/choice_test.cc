#include "core/parts/choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <vector>

#include "core/base/random.h"
#include "tests/core/support/thread_peers.h"

namespace stellate::core {
namespace {

using Stronger = std::vector<std::vector<std::uint32_t>>;  // by thing: lower ones in conflict

std::vector<std::uint8_t> Whole(const Stronger& stronger) {
  return ChooseLocalMaxima(stronger.size(), [&](std::size_t i, const auto& visit) {
    for (const std::uint32_t j : stronger[i])
      if (!visit(j)) return;
  });
}

// Each part lists its own things and what these are in conflict with.
std::vector<std::uint8_t> InParts(const Stronger& stronger, const std::vector<int>& owner,
                                  int parts) {
  std::vector<std::set<std::uint32_t>> known(static_cast<std::size_t>(parts));
  for (std::uint32_t i = 0; i < stronger.size(); ++i) {
    auto& its = known[static_cast<std::size_t>(owner[i])];
    its.insert(i);
    its.insert(stronger[i].begin(), stronger[i].end());
  }
  std::vector<std::vector<std::uint32_t>> lists;
  std::vector<std::map<std::uint32_t, std::uint32_t>> place(known.size());
  for (std::size_t part = 0; part < known.size(); ++part) {
    lists.emplace_back(known[part].begin(), known[part].end());
    for (std::uint32_t at = 0; at < lists[part].size(); ++at) place[part][lists[part][at]] = at;
  }
  std::vector<std::uint8_t> chosen(stronger.size());
  testing::ThreadPeers(parts).Run([&](const Peers& peers) {
    const auto here = static_cast<std::size_t>(peers.part());
    Borders borders{Stronger(known.size()), Stronger(known.size())};
    for (std::size_t part = 0; part < known.size(); ++part)
      for (const std::uint32_t i : lists[part]) {
        const auto whose = static_cast<std::size_t>(owner[i]);
        if (part != here && whose == here) borders.shown[part].push_back(place[here].at(i));
        if (part == here && whose != here) borders.seen[whose].push_back(place[here].at(i));
      }
    const auto its = ChooseLocalMaxima(peers, borders, lists[here].size(),
                                       [&](std::size_t at, const auto& visit) {
                                         for (const std::uint32_t j : stronger[lists[here][at]])
                                           if (!visit(place[here].at(j))) return;
                                       });
    for (std::size_t at = 0; at < its.size(); ++at)
      if (owner[lists[here][at]] == peers.part()) chosen[lists[here][at]] = its[at];
  });
  return chosen;
}

std::vector<int> Dealt(std::size_t count, int parts, Random* random) {
  std::vector<int> owner(count);
  for (int& part : owner) part = static_cast<int>(random->Next() % static_cast<unsigned>(parts));
  return owner;
}

TEST(ChoiceInParts, IsThatOfTheWhole) {
  Random random(1);
  for (const int parts : {1, 2, 3, 5, 8})
    for (int trial = 0; trial < 10; ++trial) {
      Stronger stronger(300);
      for (std::uint32_t i = 1; i < stronger.size(); ++i)
        for (std::uint64_t n = random.Next() % 5; n > 0; --n)
          stronger[i].push_back(static_cast<std::uint32_t>(random.Next() % i));
      EXPECT_EQ(InParts(stronger, Dealt(300, parts, &random), parts), Whole(stronger)) << parts;
    }
}

// Each waits for the one before: in other parts, and in its own for longer than its passes.
TEST(ChoiceInParts, FollowsChains) {
  Random random(2);
  Stronger chain(500);
  for (std::uint32_t i = 1; i < chain.size(); ++i) chain[i] = {i - 1};
  std::vector<int> halves(chain.size());
  std::fill(halves.begin() + 250, halves.end(), 1);
  EXPECT_EQ(InParts(chain, halves, 2), Whole(chain));
  EXPECT_EQ(InParts(chain, Dealt(500, 3, &random), 3), Whole(chain));
}

}  // namespace
}  // namespace stellate::core
