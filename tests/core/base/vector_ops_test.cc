#include "core/base/vector_ops.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/base/random.h"

namespace stellate::core {
namespace {

TEST(VectorOps, AreTheSumsForEveryLength) {
  Random random(1);
  for (int d = 0; d <= 40; ++d) {
    std::vector<double> a, b;
    double dot = 0, squared = 0;
    for (int i = 0; i < d; ++i) {
      a.push_back(random.NearlyNormal());
      b.push_back(random.NearlyNormal());
      dot += a.back() * b.back();
      squared += (a.back() - b.back()) * (a.back() - b.back());
    }
    EXPECT_NEAR(Dot(a.data(), b.data(), d), dot, 1e-13) << d;
    EXPECT_NEAR(SquaredDistance(a.data(), b.data(), d), squared, 1e-12) << d;
    EXPECT_EQ(Distance(a.data(), b.data(), d), std::sqrt(SquaredDistance(a.data(), b.data(), d)));
  }
}

// Where an array lies decides how a compiler may load it, and must not decide the sum.
TEST(VectorOps, DoNotDependOnAlignment) {
  Random random(2);
  constexpr int kLength = 37;
  std::vector<double> a(kLength), b(kLength);
  for (int i = 0; i < kLength; ++i) {
    a[static_cast<std::size_t>(i)] = random.NearlyNormal();
    b[static_cast<std::size_t>(i)] = random.NearlyNormal();
  }
  for (std::size_t shift = 1; shift < 5; ++shift) {
    std::vector<double> moved(kLength + shift);
    std::copy(a.begin(), a.end(), moved.begin() + static_cast<std::ptrdiff_t>(shift));
    EXPECT_EQ(Dot(moved.data() + shift, b.data(), kLength), Dot(a.data(), b.data(), kLength));
    EXPECT_EQ(SquaredDistance(moved.data() + shift, b.data(), kLength),
              SquaredDistance(a.data(), b.data(), kLength));
  }
}

}  // namespace
}  // namespace stellate::core
