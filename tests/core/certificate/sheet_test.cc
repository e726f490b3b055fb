#include "core/certificate/claims/sheet.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/claims/clearance_dips.h"

namespace stellate::core {
namespace {

// A wavy floor over [0, 1]^2 in R^3, of triangles.
class SheetTest : public ::testing::Test {
 protected:
  static constexpr int kCells = 16;
  static constexpr double kSize = 1.0 / kCells;

  SheetTest() {
    for (int i = 0; i <= kCells; ++i)
      for (int j = 0; j <= kCells; ++j)
        for (const double x : {i * kSize + 0.3 * kSize * Draw(), j * kSize, Height(i * kSize)})
          points_.push_back(x);
    view_.vertices = points_.size() / 3;
    view_.points = points_.data();
    const auto id = [](int i, int j) { return static_cast<std::uint32_t>(i * (kCells + 1) + j); };
    for (int i = 0; i < kCells; ++i)
      for (int j = 0; j < kCells; ++j)
        for (const std::array<std::uint32_t, 3> ids :
             {std::array{id(i, j), id(i, j + 1), id(i + 1, j)},
              std::array{id(i, j + 1), id(i + 1, j), id(i + 1, j + 1)}})
          sheet_.Add(ids.data(), {0, 1});
    sheet_.Index();
  }

  static MeshView OfSpace() {
    MeshView view;
    view.k = view.d = 3;
    return view;
  }
  double Draw() { return static_cast<double>(random_.Next() % 1000003) / 1000003; }
  static double Height(double x) { return 0.05 * std::cos(9 * x); }
  std::array<double, 3> DrawAbove() { return {Draw(), Draw(), 0.07 + Draw()}; }

  double BruteDistance(const double* y) const {
    double nearest = INFINITY;
    for (std::uint32_t f = 0; f < sheet_.radii.size(); ++f)
      nearest = std::min(nearest, std::sqrt(sheet_.SquaredDistanceFrom(f, y)));
    return nearest;
  }

  // As if all shares were exact, by lists alone.
  std::vector<std::uint32_t> BruteDips(const ClearPoints& clear) const {
    const std::size_t count = clear.clearances.size();
    const auto point = [&](std::size_t n) { return clear.points.data() + 3 * n; };
    std::vector<double> shares(count);
    for (std::size_t n = 0; n < count; ++n) {
      double far = INFINITY;
      for (std::uint32_t f = 0; f < sheet_.radii.size(); ++f)
        far = std::min(far, Distance(point(n), sheet_.barycentres.data() + 3 * f, 3));
      if (far < 4 * sheet_.largest_radius) far = BruteDistance(point(n));
      if (clear.clearances[n] != 0 && far > 0.15 * kSize) shares[n] = clear.clearances[n] / far;
    }
    std::vector<std::pair<double, std::uint32_t>> dips;
    for (std::uint32_t n = 0; n < count; ++n) {
      if (shares[n] == 0) continue;
      std::vector<std::pair<double, std::uint32_t>> nearest;
      for (std::uint32_t other = 0; other < count; ++other) {
        const double away = Distance(point(n), point(other), 3);
        if (away >= kSize / 4 && shares[other] != 0) nearest.emplace_back(away, other);
      }
      std::sort(nearest.begin(), nearest.end());
      nearest.resize(std::min<std::size_t>(nearest.size(), 48));
      std::vector<std::uint32_t> near;
      std::vector<double> theirs;
      for (const auto& [away, other] : nearest) {
        const bool is_apart = std::all_of(near.begin(), near.end(), [&](std::uint32_t taken) {
          return Distance(point(taken), point(other), 3) >= kSize / 4;
        });
        if (!is_apart || near.size() == 8) continue;
        near.push_back(other);
        theirs.push_back(shares[other]);
      }
      if (near.empty()) continue;
      std::sort(theirs.begin(), theirs.end());
      const double dip = shares[n] / theirs[theirs.size() / 2];
      if (dip <= 0.85) dips.emplace_back(dip, n);
    }
    std::sort(dips.begin(), dips.end());
    std::vector<std::uint32_t> ids;
    for (const auto& [dip, n] : dips) ids.push_back(n);
    return ids;
  }

  Random random_{7};
  std::vector<double> points_;
  MeshView view_ = OfSpace();
  Sheet sheet_{view_};
};

TEST_F(SheetTest, ItsDistanceIsThatOfTheNearestOfAllSimplices) {
  for (int i = 0; i < 400; ++i) {
    std::array<double, 3> y = DrawAbove();
    y[2] -= 0.2 * (i % 5);
    y[0] = 3 * y[0] - 1;  // beyond its border, too
    EXPECT_DOUBLE_EQ(sheet_.DistanceFrom(y.data()), BruteDistance(y.data()));
  }
  EXPECT_EQ(sheet_.DistanceFrom(points_.data()), 0);
  EXPECT_EQ(Sheet(view_).DistanceFrom(points_.data()), INFINITY);
}

TEST_F(SheetTest, DipsAreThoseThatExactSharesWouldShow) {
  ClearPoints clear;
  // Clearances that fade with height, as a solver's may, and a second sheet, a ball at mid-height.
  const std::array<double, 3> ball{0.6, 0.4, 0.5};
  const auto add = [&](const std::array<double, 3>& y) {
    const double floor = BruteDistance(y.data()) * (1 + y[2]);
    const double other = std::abs(Distance(y.data(), ball.data(), 3) - 0.1);
    clear.points.insert(clear.points.end(), y.begin(), y.end());
    clear.clearances.push_back(Draw() < 0.05 ? 0 : std::min(floor, other));
  };
  for (int i = 0; i < 900; ++i) add(DrawAbove());
  const std::array<double, 3> often = DrawAbove();
  for (int i = 0; i < 60; ++i) add({often[0] + 1e-4 * Draw(), often[1], often[2]});

  ClearanceDips dips(clear, 1, 0, sheet_, kSize);
  std::size_t known = 0;
  for (int call = 0; call < 2; ++call) {
    BallTree tree(3, &clear.points);
    tree.Assign(std::vector<double>(clear.clearances.size()));
    std::vector<std::uint32_t> expected = BruteDips(clear);
    std::erase_if(expected, [&](std::uint32_t n) { return n < known; });
    EXPECT_GE(expected.size(), 5u);
    EXPECT_EQ(dips.Find(tree, 10000), expected);
    known = clear.clearances.size();
    for (int i = 0; i < 300; ++i) add(DrawAbove());
  }
  BallTree tree(3, &clear.points);
  tree.Assign(std::vector<double>(clear.clearances.size()));
  EXPECT_LE(dips.Find(tree, 2).size(), 2u);
}

}  // namespace
}  // namespace stellate::core
