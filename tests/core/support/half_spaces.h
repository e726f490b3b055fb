#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/surroundings.h"

// Half-spaces for cells to be cut by, and the vertices of what they leave, without a cell.
namespace stellate::core::testing {

template <int K>
using Vec = Eigen::Matrix<double, K, 1>;

template <int K>
struct HalfSpace {
  std::uint32_t id = 0;
  Vec<K> normal;
  double offset = 0;
};

template <int K>
using HalfSpaces = std::vector<HalfSpace<K>>;

// A weight such as Stars adds to each point, against degenerate positions, for lengths near
// 1: far above rounding, far below anything geometric.
inline double Weight(std::uint32_t id) {
  return 1e-10 * static_cast<double>(Mix64(id) >> 11) * 0x1p-53;
}

template <int K>
Vec<K> RandomUnit(Random& random) {
  Vec<K> u;
  for (int a = 0; a < K; ++a) u[a] = random.NearlyNormal();
  return u.normalized();
}

// Half-spaces tangent to spheres of radius 0.5 to 1.5, as a star's neighbours give them.
template <int K>
HalfSpaces<K> RandomHalfSpaces(int count, std::uint64_t seed) {
  Random random(seed, K);
  HalfSpaces<K> all(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    auto& h = all[static_cast<std::size_t>(i)];
    h.id = static_cast<std::uint32_t>(i) * 7 + 3;
    const double distance = 0.5 + random.Uniform();
    h.normal = 2 * distance * RandomUnit<K>(random);
    h.offset = 2 * distance * distance;
  }
  return all;
}

template <int K>
HalfSpaces<K> Cube() {
  HalfSpaces<K> all;
  for (int a = 0; a < K; ++a)
    for (const int sign : {-1, 1})
      all.push_back({static_cast<std::uint32_t>(all.size()), sign * Vec<K>::Unit(a), 1});
  return all;
}

// The neighbours of the origin in the integer grid: all but 2K of them touch the cube without
// cutting it. With weights, what touches either misses or cuts a tiny corner off.
template <int K>
HalfSpaces<K> Grid(bool weighted) {
  HalfSpaces<K> all;
  int total = 1;
  for (int a = 0; a < K; ++a) total *= 3;
  for (int code = 0; code < total; ++code) {
    Vec<K> q;
    for (int a = 0, c = code; a < K; ++a, c /= 3) q[a] = c % 3 - 1;
    const auto id = static_cast<std::uint32_t>(all.size());
    const double weight = weighted ? Weight(id) : 0;
    if (q.squaredNorm() > 0) all.push_back({id, q, 0.5 * (q.squaredNorm() - weight)});
  }
  return all;
}

template <typename T>
void Shuffle(std::vector<T>* items, std::uint64_t seed) {
  Random random(seed);
  for (std::size_t i = items->size(); i > 1; --i)
    std::swap((*items)[i - 1], (*items)[random.Next() % i]);
}

// The facets of the simplex that a cell begins as, as half-spaces.
template <int K>
HalfSpaces<K> FakeHalfSpaces(double inradius) {
  HalfSpaces<K> all;
  for (int i = 0; i <= K; ++i) {
    Vec<K> normal;
    const double offset = FakeHalfSpace<K>(i, inradius, normal.data());
    all.push_back({kFirstFakeId + static_cast<std::uint32_t>(i), normal, offset});
  }
  return all;
}

template <int K>
using Vertices = std::map<std::vector<std::uint32_t>, Vec<K>>;  // by facet ids, ascending

// Each K of the half-spaces meet in a point, which is a vertex unless another cuts it off.
template <int K>
Vertices<K> BruteForceVertices(const HalfSpaces<K>& half_spaces) {
  Vertices<K> all;
  const int n = static_cast<int>(half_spaces.size());
  std::vector<int> pick(K);
  const auto try_subset = [&] {
    Eigen::MatrixXd m(K, K);  // of any size: compiling a decomposition for each K takes a minute
    Eigen::VectorXd rhs(K);
    std::vector<std::uint32_t> ids;
    for (int r = 0; r < K; ++r) {
      const auto& h = half_spaces[static_cast<std::size_t>(pick[static_cast<std::size_t>(r)])];
      m.row(r) = h.normal.transpose();
      rhs[r] = h.offset;
      ids.push_back(h.id);
    }
    const Eigen::FullPivLU<Eigen::MatrixXd> lu(m);
    if (!lu.isInvertible()) return;
    const Vec<K> x = lu.solve(rhs);
    for (const auto& h : half_spaces)
      if (std::find(ids.begin(), ids.end(), h.id) == ids.end() && h.normal.dot(x) > h.offset)
        return;
    std::sort(ids.begin(), ids.end());
    all[ids] = x;
  };
  const auto choose = [&](auto&& self, int depth, int from) -> void {
    if (depth == K) return try_subset();
    for (int i = from; i < n; ++i) {
      pick[static_cast<std::size_t>(depth)] = i;
      self(self, depth + 1, i + 1);
    }
  };
  choose(choose, 0, 0);
  return all;
}

}  // namespace stellate::core::testing
