#include "core/certificate/evidence/probes.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/point_of.h"

namespace stellate::core {
namespace {

// Streams of random numbers that no other part of the core uses.
enum Stream : std::uint64_t { kSimplexStream = 0x6365727430, kVertexStream, kProbeStream };

constexpr double kBoxMargin = 0.1;      // of the diagonal, around the mesh's own box
constexpr std::uint32_t kKeptFold = 4;  // of how many are sought
constexpr std::uint64_t kBoxedTogether = 1 << 14;

void SortUnique(std::vector<std::uint32_t>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

// Returns the `count` simplices of largest value. REQUIRES: there are as many.
void AppendLargest(const std::vector<float>& values, std::uint32_t count,
                   std::vector<std::uint32_t>& chosen) {
  const auto is_larger = [&values](std::uint32_t a, std::uint32_t b) {
    return values[a] != values[b] ? values[a] > values[b] : a < b;
  };
  // The simplices that may be among them, a bounded number: later ones must be larger.
  std::vector<std::uint32_t> kept;
  float least = -std::numeric_limits<float>::infinity();
  const auto keep_largest = [&] {
    std::nth_element(kept.begin(), kept.begin() + count, kept.end(), is_larger);
    kept.resize(count);
    least = values[*std::max_element(kept.begin(), kept.end(), is_larger)];
  };
  for (std::uint32_t i = 0; i < values.size(); ++i) {
    CheckInterruption(i);
    if (!(values[i] > least)) continue;
    kept.push_back(i);
    if (kept.size() == std::size_t{kKeptFold} * count) keep_largest();
  }
  keep_largest();
  chosen.insert(chosen.end(), kept.begin(), kept.end());
}

Eigen::VectorXd PointInBox(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                           Random& random) {
  Eigen::VectorXd x(lower.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    x[i] = lower[i] + random.Uniform() * (upper[i] - lower[i]);
  }
  return x;
}

Eigen::VectorXd PointNearSimplex(const MeshView& mesh, const std::uint32_t* ids, double push,
                                 Random& random) {
  // The k + 1 pieces into which k uniform numbers cut the unit interval are the weights of a
  // uniform point.
  std::vector<double> cuts(static_cast<std::size_t>(mesh.k) + 2);
  std::generate(cuts.begin() + 1, cuts.end() - 1, [&] { return random.Uniform(); });
  cuts.back() = 1;
  std::sort(cuts.begin(), cuts.end());
  Eigen::VectorXd x = Eigen::VectorXd::Zero(mesh.d);
  for (int i = 0; i <= mesh.k; ++i) {
    const auto at = static_cast<std::size_t>(i);
    x += (cuts[at + 1] - cuts[at]) * PointOf(mesh, ids[i]);
  }
  Eigen::VectorXd direction(mesh.d);
  for (double& along : direction) along = random.NearlyNormal();
  return x + push * random.Uniform() * direction.normalized();
}

// How many random points of the client's box the run began with.
std::uint64_t KnownOfBox(const Specification& spec) {
  if (spec.seeds.cols() > 0) return 0;
  return static_cast<std::uint64_t>(spec.box_seeds > 0 ? spec.box_seeds : kDefaultBoxSeeds);
}

MeshBox BoxOfPart(const MeshView& mesh, std::uint32_t begin, std::uint32_t end) {
  MeshBox box{PointOf(mesh, begin), PointOf(mesh, begin)};
  WithDimension(mesh.d, [&](auto known) {
    const int d = known() > 0 ? known() : mesh.d;
    double* const lower = box.lower.data();
    double* const upper = box.upper.data();
    const double* x = mesh.Point(begin);
    for (std::uint32_t v = begin; v < end; ++v, x += d) {
      for (int i = 0; i < d; ++i) {
        lower[i] = std::min(lower[i], x[i]);
        upper[i] = std::max(upper[i], x[i]);
      }
    }
  });
  return box;
}

}  // namespace

MeshBox BoxOf(const MeshView& mesh) {
  std::vector<MeshBox> parts((mesh.vertices + kBoxedTogether - 1) / kBoxedTogether);
  ParallelFor(parts.size(), [&](std::size_t part) {
    const auto begin = static_cast<std::uint32_t>(part * kBoxedTogether);
    parts[part] = BoxOfPart(
        mesh, begin, static_cast<std::uint32_t>(std::min(mesh.vertices, begin + kBoxedTogether)));
  });
  MeshBox box = parts.front();
  for (const MeshBox& part : parts) {
    box.lower = box.lower.cwiseMin(part.lower);
    box.upper = box.upper.cwiseMax(part.upper);
  }
  return box;
}

std::vector<std::uint32_t> ChooseSimplices(const SimplexList& list, const MeshShape& shape,
                                           std::uint64_t random_seed) {
  std::vector<std::uint32_t> chosen;
  if (list.size() <= kMaxBarycentres) {
    chosen.resize(list.size());
    std::iota(chosen.begin(), chosen.end(), 0u);
    return chosen;
  }
  Random random(random_seed, kSimplexStream);
  for (std::uint32_t n = 0; n < kMaxBarycentres; ++n) {
    chosen.push_back(static_cast<std::uint32_t>(random.Next() % list.size()));
  }
  AppendLargest(shape.diameters, kExtremeBarycentres, chosen);
  AppendLargest(shape.tilts, kExtremeBarycentres, chosen);
  SortUnique(chosen);
  return chosen;
}

std::vector<std::uint32_t> ChooseVertices(std::uint32_t vertices, std::uint64_t random_seed) {
  std::vector<std::uint32_t> chosen;
  const std::uint32_t count =
      std::clamp(vertices / kVertexStride, kMinVertexProbes, kMaxVertexProbes);
  if (vertices <= count) {
    chosen.resize(vertices);
    std::iota(chosen.begin(), chosen.end(), 0u);
    return chosen;
  }
  Random random(random_seed, kVertexStream);
  for (std::uint32_t n = 0; n < count; ++n) {
    chosen.push_back(static_cast<std::uint32_t>(random.Next() % vertices));
  }
  SortUnique(chosen);
  return chosen;
}

Eigen::MatrixXd PointsInside(const MeshView& mesh, const SimplexList& list,
                             const std::vector<std::uint32_t>& chosen, int each) {
  Eigen::MatrixXd result =
      Eigen::MatrixXd::Zero(mesh.d, each * static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t n = 0; n < chosen.size(); ++n) {
    const std::uint32_t* ids = list[chosen[n]];
    auto barycentre = result.col(each * static_cast<Eigen::Index>(n));
    for (int i = 0; i <= mesh.k; ++i) barycentre += PointOf(mesh, ids[i]);
    barycentre /= mesh.k + 1;
    for (int i = 1; i < each; ++i)
      result.col(each * static_cast<Eigen::Index>(n) + i) =
          (barycentre + PointOf(mesh, ids[i - 1])) / 2;
  }
  return result;
}

Eigen::MatrixXd CoverageProbes(const Specification& spec, const MeshView& mesh,
                               const SimplexList& list, double push) {
  Random random(spec.random_seed, kProbeStream);
  MeshBox box = BoxOf(mesh);
  const double margin = kBoxMargin * (box.upper - box.lower).norm();
  box.lower.array() -= margin;
  box.upper.array() += margin;
  constexpr std::uint64_t kBoxOfClient = 2;
  const std::uint64_t kinds = spec.bounding_box ? 3 : 2;
  const auto probe = [&](std::uint64_t kind) -> Eigen::VectorXd {
    if (kind == 1) return PointInBox(box.lower, box.upper, random);
    if (kind == kBoxOfClient)
      return PointInBox(spec.bounding_box->lower, spec.bounding_box->upper, random);
    const auto s = static_cast<std::uint32_t>(random.Next() % list.size());
    return PointNearSimplex(mesh, list[s], push, random);
  };
  const std::uint64_t each = std::max(kProbesOfAKind, mesh.vertices / (kVerticesAProbe * kinds));
  std::vector<Eigen::VectorXd> probes;
  for (std::uint64_t kind = 0; kind < kinds; ++kind)
    for (std::uint64_t n = kind == kBoxOfClient ? std::min(each, KnownOfBox(spec)) : 0; n < each;
         ++n)
      probes.push_back(probe(kind));

  Eigen::MatrixXd result(mesh.d, static_cast<Eigen::Index>(probes.size()));
  for (std::size_t n = 0; n < probes.size(); ++n) result.col(n) = probes[n];
  return result;
}

}  // namespace stellate::core
