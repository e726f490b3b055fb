#include "core/run/crease_watch.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <set>
#include <tuple>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMostWays = 6;
// In mesh sizes: at crossings, the error of points that are nearer to each other is as large as
// their distance.
constexpr double kShortest = 1.0 / 256;

struct Edge {
  std::uint32_t p = 0, q = 0;
  double turn2 = 0, length2 = 0;  // the sum of squared sines; the length, squared
};

template <int K>
double SumOfSquaredSinesBetween(const double* one, const double* other, int d) {
  double kept = 0;
  for (int a = 0; a < K; ++a)
    for (int b = 0; b < K; ++b) {
      const double cosine = Dot(one + a * d, other + b * d, d);
      kept += cosine * cosine;
    }
  return K - kept;
}

template <int K>
std::vector<Edge> EdgesThatTurn(const Stars<K>& stars, const std::vector<std::uint32_t>& ids,
                                double longest, double shortest, double least_sine2) {
  return ParallelGather<Edge>(ids.size(), [&](std::size_t i, std::vector<Edge>* found) {
    const std::uint32_t p = ids[i];
    const auto& cell = stars.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      const std::uint32_t q = cell.id(f);
      if (!IsSample(q)) continue;
      Edge edge{std::min(p, q), std::max(p, q), 0, 0};
      edge.length2 =
          SquaredDistance(stars.sample().Point(p), stars.sample().Point(q), stars.sample().d());
      if (edge.length2 > longest * longest || edge.length2 < shortest * shortest) continue;
      edge.turn2 = SumOfSquaredSinesBetween<K>(stars.sample().Tangent(edge.p),
                                               stars.sample().Tangent(edge.q), stars.sample().d());
      if (edge.turn2 >= least_sine2) found->push_back(edge);
    }
  });
}

template <int K>
std::vector<Way> Steepest(const Stars<K>& stars, std::vector<Edge> edges,
                          WalkedEdges* walked = nullptr) {
  std::vector<Way> ways;
  std::set<std::uint32_t> used;
  std::size_t taken = 0;
  const auto take = [&](std::size_t most) {
    for (std::size_t i = 0; i < edges.size() && taken < most; ++i) {
      const auto& [p, q, turn2, length2] = edges[i];
      if (used.count(p) + used.count(q) > 0) continue;
      used.insert({p, q});
      ++taken;
      if (walked && !walked->insert({p, q}).second) continue;
      const auto point = [&](std::uint32_t v) {
        return Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(v), stars.sample().d());
      };
      const auto basis = [&](std::uint32_t v) {
        return Eigen::Map<const Eigen::MatrixXd>(stars.sample().Tangent(v), stars.sample().d(), K);
      };
      ways.push_back({point(p), point(q), basis(p), basis(q)});
    }
  };
  ParallelSort(edges, [](const Edge& a, const Edge& b) {
    return std::tuple(-a.turn2, a.length2, a.p, a.q) < std::tuple(-b.turn2, b.length2, b.p, b.q);
  });
  take(kMostWays / 2);
  ParallelSort(edges, [](const Edge& a, const Edge& b) {
    return std::tuple(-a.turn2 / a.length2, a.p, a.q) < std::tuple(-b.turn2 / b.length2, b.p, b.q);
  });
  take(kMostWays);
  return ways;
}

}  // namespace

bool CreaseWatch::IsDue(std::uint64_t left, bool judges_all) {
  const bool begins = judges_all && !judged_all_;
  const bool progress = 2 * left <= left_then_ || (front_moved_ && rounds_ < kLongestFront);
  judged_all_ = judges_all;
  front_moved_ = false;
  ++rounds_;
  if (begins || progress) {
    left_then_ = left;
    rounds_since_ = 0;
  }
  if (rounds_since_++ < patience_) return false;
  patience_ *= 2;
  rounds_since_ = 0;
  left_then_ = left;
  return true;
}

template <int K>
std::vector<Way> SteepWaysAtFaults(const Engine<K>& engine, double longest, double least_sine2,
                                   WalkedEdges* walked) {
  std::vector<std::uint32_t> ids = engine.violations().violating_stars();
  for (const auto& entry : engine.violations().size_and_shape()) {
    CheckInterruption(ids.size());
    ids.push_back(entry.star);
  }
  const Stars<K>& stars = engine.stars();
  const double epsilon = engine.criteria().epsilon;
  std::vector<Edge> edges = EdgesThatTurn<K>(stars, ids, longest, kShortest * epsilon, least_sine2);
  std::erase_if(edges, [&](const Edge& edge) {
    const double size = std::min(engine.sizes().BoundAt(stars, edge.p) / epsilon, 1.0);
    return edge.length2 > longest * longest * size * size;
  });
  return Steepest<K>(stars, std::move(edges), walked);
}

template <int K>
std::vector<Way> SteepWays(const Stars<K>& stars, double longest) {
  std::vector<std::uint32_t> ids(stars.size());
  std::iota(ids.begin(), ids.end(), 0u);
  return Steepest<K>(stars,
                     EdgesThatTurn<K>(stars, ids, longest, kShortest * longest, kLeastSine2));
}

#define STELLATE_EACH(K)                                                                          \
  template std::vector<Way> SteepWaysAtFaults<K>(const Engine<K>&, double, double, WalkedEdges*); \
  template std::vector<Way> SteepWays<K>(const Stars<K>&, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
