#include "core/complex/centre_cache.h"

#include <gtest/gtest.h>

#include <vector>

namespace stellate::core {
namespace {

// Counts what it is asked for, and tells simplex and owner apart.
struct Asked {
  CentreCache<2> cache;
  int times = 0;

  std::vector<double> Centre(std::uint64_t owner, const CentreCache<2>::Simplex& simplex,
                             std::uint64_t key, int d, bool exists = true) {
    std::vector<double> centre(static_cast<std::size_t>(d), -1);
    const bool found = cache.Centre(owner, simplex, key, d, centre.data(), [&](double* x) {
      ++times;
      for (int i = 0; i < d; ++i) x[i] = static_cast<double>(owner) * 100 + simplex[0] + i;
      return exists;
    });
    EXPECT_EQ(found, exists);
    return centre;
  }
};

TEST(CentreCache, RemembersASimplex) {
  Asked asked;
  for (int again = 0; again < 3; ++again)
    EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 3), (std::vector<double>{104, 105, 106}));
  EXPECT_EQ(asked.times, 1);
}

TEST(CentreCache, RemembersThatThereIsNone) {
  Asked asked;
  for (int again = 0; again < 3; ++again)
    EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 2, false), (std::vector<double>{-1, -1}));
  EXPECT_EQ(asked.times, 1);
}

TEST(CentreCache, TakesNoSimplexForAnotherOfTheSameKey) {
  Asked asked;
  EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 1), std::vector<double>{104});
  EXPECT_EQ(asked.Centre(1, {3, 5, 6}, 77, 1), std::vector<double>{103});
  EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 1), std::vector<double>{104});
  EXPECT_EQ(asked.times, 3);
}

TEST(CentreCache, TakesNothingFromAnotherOwner) {
  Asked asked;
  CentreCache<2>::Owner owner;
  const CentreCache<2>::Owner copy = owner;
  const std::uint64_t one = owner.id(), other = copy.id();
  EXPECT_NE(one, other);
  owner = copy;
  EXPECT_NE(owner.id(), one);
  EXPECT_NE(owner.id(), other);
  const std::vector<double> first = asked.Centre(one, {4, 5, 6}, 77, 2);
  EXPECT_NE(asked.Centre(other, {4, 5, 6}, 77, 2), first);
  EXPECT_EQ(asked.times, 2);
}

TEST(CentreCache, ForgetsWhenTheDimensionChanges) {
  Asked asked;
  asked.Centre(1, {4, 5, 6}, 77, 2);
  EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 3), (std::vector<double>{104, 105, 106}));
  EXPECT_EQ(asked.Centre(1, {4, 5, 6}, 77, 2), (std::vector<double>{104, 105}));
  EXPECT_EQ(asked.times, 3);
}

}  // namespace
}  // namespace stellate::core
