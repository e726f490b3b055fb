#include "tests/truth/knots.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

namespace stellate::truth {
namespace {

using Eigen::MatrixXd;

constexpr std::int64_t kPrime = 2'147'483'629;  // far above the determinants that occur

// Where edge `a` of one polygon passes over edge `b` of another, seen along the third axis.
struct Crossing {
  Eigen::Index over = 0, under = 0;
  double over_at = 0, under_at = 0;  // of the edge, in (0, 1)
  int sign = 0;
};

// A direction of sight in which nothing lines up.
MatrixXd Turned(const MatrixXd& polygon) {
  const Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.7312, Eigen::Vector3d(0.36, 0.48, 0.8)) *
       Eigen::AngleAxisd(1.2345, Eigen::Vector3d(0.8, -0.6, 0).normalized()))
          .toRotationMatrix();
  return turn * polygon;
}

std::vector<Crossing> CrossingsOf(const MatrixXd& p, const MatrixXd& q, bool same) {
  std::vector<Crossing> crossings;
  const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a[0] * b[1] - a[1] * b[0];
  };
  for (Eigen::Index i = 0; i < p.cols(); ++i) {
    const Eigen::Vector3d a = p.col(i), u = p.col((i + 1) % p.cols()) - a;
    for (Eigen::Index j = 0; j < q.cols(); ++j) {
      if (same && i == j) continue;
      const Eigen::Vector3d b = q.col(j), v = q.col((j + 1) % q.cols()) - b;
      const double turn = cross(u.head(2), v.head(2));
      const Eigen::Vector2d w = (b - a).head(2);
      const double s = cross(w, v.head(2)) / turn, t = cross(w, u.head(2)) / turn;
      if (!(s > 0 && s < 1 && t > 0 && t < 1)) continue;
      if (a[2] + s * u[2] <= b[2] + t * v[2]) continue;  // seen from the other edge
      crossings.push_back({i, j, s, t, turn > 0 ? 1 : -1});
    }
  }
  return crossings;
}

std::int64_t Power(std::int64_t x, std::int64_t n) {
  std::int64_t result = 1;
  for (x %= kPrime; n > 0; n >>= 1, x = x * x % kPrime)
    if (n & 1) result = result * x % kPrime;
  return result;
}

// |det| of the matrix of colourings without its last row and column.
std::uint64_t Determinant(const MatrixXd& polygon) {
  std::vector<Crossing> crossings = CrossingsOf(polygon, polygon, true);
  const std::size_t n = crossings.size();
  if (n < 3) return 1;
  // Arc i begins at the i-th passage below, in the order of the curve.
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return std::pair(a.under, a.under_at) < std::pair(b.under, b.under_at);
  });
  const auto arc_at = [&](Eigen::Index edge, double at) {
    std::size_t arc = n - 1;
    for (std::size_t i = 0; i < n; ++i)
      if (std::pair(crossings[i].under, crossings[i].under_at) < std::pair(edge, at)) arc = i;
    return arc;
  };
  std::vector<std::vector<std::int64_t>> a(n, std::vector<std::int64_t>(n, 0));
  for (std::size_t i = 0; i < n; ++i) {
    a[i][arc_at(crossings[i].over, crossings[i].over_at)] += 2;
    a[i][i] -= 1;
    a[i][(i + n - 1) % n] -= 1;
  }
  std::int64_t det = 1;
  for (std::size_t c = 0; c + 1 < n; ++c) {
    std::size_t pivot = c;
    while (pivot + 1 < n && a[pivot][c] % kPrime == 0) ++pivot;
    if (pivot + 1 >= n) return 0;
    std::swap(a[pivot], a[c]);
    det = det * ((a[c][c] % kPrime + kPrime) % kPrime) % kPrime;
    const std::int64_t inverse = Power((a[c][c] % kPrime + kPrime) % kPrime, kPrime - 2);
    for (std::size_t r = c + 1; r + 1 < n; ++r) {
      const std::int64_t factor = (a[r][c] % kPrime + kPrime) % kPrime * inverse % kPrime;
      if (factor == 0) continue;
      for (std::size_t j = c; j + 1 < n; ++j) a[r][j] = (a[r][j] - factor * a[c][j]) % kPrime;
    }
  }
  return static_cast<std::uint64_t>(std::min(det, kPrime - det));
}

}  // namespace

std::vector<MatrixXd> Polygons(const MatrixXd& points, const std::vector<std::uint32_t>& edges) {
  std::map<std::uint32_t, std::vector<std::uint32_t>> next;
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    next[edges[i]].push_back(edges[i + 1]);
    next[edges[i + 1]].push_back(edges[i]);
  }
  std::vector<MatrixXd> polygons;
  while (!next.empty()) {
    std::vector<std::uint32_t> ids;
    std::uint32_t v = next.begin()->first, from = v;
    for (auto at = next.find(v); at != next.end(); at = next.find(v)) {
      if (at->second.size() != 2) return {};
      ids.push_back(v);
      const std::uint32_t to = at->second[0] == from ? at->second[1] : at->second[0];
      next.erase(at);
      from = std::exchange(v, to);
    }
    MatrixXd polygon(points.rows(), static_cast<Eigen::Index>(ids.size()));
    for (std::size_t i = 0; i < ids.size(); ++i)
      polygon.col(static_cast<Eigen::Index>(i)) = points.col(ids[i]);
    polygons.push_back(std::move(polygon));
  }
  return polygons;
}

KnotType KnotTypeOf(const std::vector<MatrixXd>& polygons) {
  KnotType type;
  std::vector<MatrixXd> turned;
  for (const MatrixXd& p : polygons) turned.push_back(Turned(p));
  for (std::size_t i = 0; i < turned.size(); ++i) {
    type.determinants.push_back(Determinant(turned[i]));
    for (std::size_t j = 0; j < i; ++j) {
      int linking = 0;
      for (const Crossing& c : CrossingsOf(turned[i], turned[j], false)) linking += c.sign;
      type.linking.push_back(std::abs(linking));
    }
  }
  std::sort(type.determinants.begin(), type.determinants.end());
  std::sort(type.linking.begin(), type.linking.end());
  return type;
}

}  // namespace stellate::truth
