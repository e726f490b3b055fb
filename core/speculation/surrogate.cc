#include "core/speculation/surrogate.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// A prediction is used if its uncertainty is below this share of the sample's spacing: then its
// slope is about right, and a smooth error of the height moves all closest points alike;
constexpr double kSure = 0.1;
// or below this share of the spacing that the point is for.
constexpr double kSureForSpacing = 0.25;
// If points shift by a few hundredths of epsilon, many simplices that were planned just smaller
// than epsilon are just larger, and each costs a vertex. Therefore points that are not known this
// well, as a share of the spacing, are planned this much coarser at first, unless the sample is so
// fine, in epsilon, that predictions will not become better.
constexpr double kExact = 0.02;
constexpr double kMargin = 1.15;
constexpr double kFine = 1.6;
// Neighbours whose tangent space is turned further than this are around a corner: |T_p^t T_q| is
// the cosine.
constexpr double kLeastCosine = 0.5;
// Ridges keep the fit determined if there are few neighbours; the terms are of order one after
// scaling.
constexpr double kQuadraticRidge = 1e-6;
constexpr double kCubicRidge = 1e-4;
// A prediction from a point this near, in spacings of the sample, is used as that point alone gives
// it.
constexpr double kNearGuess = 0.1;
// At most so many consecutive points share a search, if they lie within this share of its radius.
constexpr std::size_t kRun = 32;
constexpr double Shared(int k) { return k < 3 ? 1 : 0.5; }
// More than rounding can take from a distance in R^d, d up to thousands.
constexpr double kRoundedUp = 1 + 1e-12;
// The least doubt in a fit, as a share of the neighbours' distance; and the least if there are
// hardly more equations than coefficients.
constexpr double kLeastDoubt = 0.003;
constexpr double kScantDoubt = 0.03;

}  // namespace

// u_a u_b for a <= b, then u_a u_b u_c for a <= b <= c.
template <int K>
void Surrogate<K>::Terms(const double* v, double* terms) {
  int t = 0;
  for (int a = 0; a < K; ++a)
    for (int b = a; b < K; ++b) terms[t++] = v[a] * v[b];
  for (int a = 0; a < K; ++a)
    for (int b = a; b < K; ++b)
      for (int c = b; c < K; ++c) terms[t++] = v[a] * v[b] * v[c];
}

// slopes[a]: the derivatives of the terms along axis a.
template <int K>
void Surrogate<K>::Slopes(const double* v, double (*slopes)[kTerms]) {
  for (int s = 0; s < K; ++s) {
    int t = 0;
    for (int a = 0; a < K; ++a)
      for (int b = a; b < K; ++b) slopes[s][t++] = (a == s ? v[b] : 0) + (b == s ? v[a] : 0);
    for (int a = 0; a < K; ++a)
      for (int b = a; b < K; ++b)
        for (int c = b; c < K; ++c)
          slopes[s][t++] =
              (a == s ? v[b] * v[c] : 0) + (b == s ? v[a] * v[c] : 0) + (c == s ? v[a] * v[b] : 0);
  }
}

template <int K>
Surrogate<K>::Surrogate(const Stars<K>& stars, double step, double epsilon, const double* sizes)
    : stars_(stars),
      sizes_(sizes),
      step_(step),
      epsilon_(epsilon),
      form_size_(static_cast<std::size_t>(kTerms) * static_cast<std::size_t>(stars.sample().d())),
      slot_(stars.size(), kNone) {}

template <int K>
void Surrogate<K>::Fit(std::uint32_t p, std::uint32_t slot) {
  using Frame = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, K>>;
  const auto& cell = stars_.cell(p);
  const int d = stars_.sample().d();
  const Frame tangent(stars_.sample().Tangent(p), d, K);
  // Neighbours one after the other: u and length, q off the tangent plane, and the slopes there,
  // the derivatives of that by u (K rows of d).
  thread_local std::vector<double> neighbours;
  neighbours.clear();
  const auto stride = (K + 1) * (1 + static_cast<std::size_t>(d));
  double total = 0;
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    const std::uint32_t neighbour = cell.id(f);
    if (!IsSample(neighbour)) continue;
    const Frame other(stars_.sample().Tangent(neighbour), d, K);
    const Eigen::Matrix<double, K, K> turn = tangent.transpose() * other;
    if (turn.squaredNorm() < K - 1 + kLeastCosine * kLeastCosine) continue;
    neighbours.resize(neighbours.size() + stride);
    double* const n = neighbours.data() + neighbours.size() - stride;
    stars_.HalfSpace(p, f, n);
    const Eigen::Map<const Eigen::Matrix<double, K, 1>> u(n);
    Eigen::Map<Eigen::VectorXd> away(n + K + 1, d);
    const double* q = stars_.sample().Point(neighbour);
    const double* at = stars_.sample().Point(p);
    for (int j = 0; j < d; ++j) away[j] = q[j] - at[j];
    away.noalias() -= tangent * u;
    const double length2 = u.squaredNorm();
    if (!(length2 > away.squaredNorm())) {
      neighbours.resize(neighbours.size() - stride);
      continue;
    }
    n[K] = std::sqrt(length2);
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, K>> slopes(n + K + 1 + d, d, K);
    const Eigen::Matrix<double, K, K> back = Inverse<K>(turn);
    slopes.noalias() = other * back;
    slopes -= tangent;
    total += n[K];
  }
  const std::size_t count = neighbours.size() / stride;
  Graph& graph = graphs_[slot];
  graph = {};
  double* out = forms_.data() + slot * form_size_;
  std::fill(out, out + form_size_, 0.0);
  if (count <= K) return;
  const double scale = total / static_cast<double>(count);

  // Normal equations, the lower half, and their right-hand sides, d for each term.
  double normal[kTerms][kTerms] = {}, terms[kTerms], slopes[K][kTerms];
  thread_local std::vector<double> right;
  right.assign(form_size_, 0.0);
  const auto add = [&](const double* row, const double* value, double weight, double value_weight) {
    for (int s = 0; s < kTerms; ++s) {
      const double w = weight * weight * row[s];
      for (int t = 0; t <= s; ++t) normal[s][t] += w * row[t];
      const double v = weight * value_weight * row[s];
      double* const right_of = right.data() + s * d;
      for (int j = 0; j < d; ++j) right_of[j] += v * value[j];
    }
  };
  for (std::size_t i = 0; i < count; ++i) {
    const double* const n = neighbours.data() + i * stride;
    double v[K];
    for (int a = 0; a < K; ++a) v[a] = n[a] / scale;
    // Divided by |u|^2 places, and by |u| slopes, are all of the curvature's size.
    const double weight = scale / n[K];
    Terms(v, terms);
    add(terms, n + K + 1, weight * weight, weight * weight);
    Slopes(v, slopes);
    for (int a = 0; a < K; ++a) add(slopes[a], n + K + 1 + (a + 1) * d, weight, weight * scale);
  }
  for (int t = 0; t < kTerms; ++t) normal[t][t] += t < kQuadratic ? kQuadraticRidge : kCubicRidge;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Rows>(out, kTerms, d) =
      SolveSymmetric(Eigen::Map<const Rows>(normal[0], kTerms, kTerms),
                     Eigen::Map<const Rows>(right.data(), kTerms, d));
  graph.scale = scale;
  const bool scant = static_cast<double>(count * (K + 1)) < 1.5 * kTerms;
  graph.error = (scant ? kScantDoubt : kLeastDoubt) * scale;
  for (std::size_t i = 0; i < count; ++i) {
    const double* const n = neighbours.data() + i * stride;
    double v[K];
    for (int a = 0; a < K; ++a) v[a] = n[a] / scale;
    Terms(v, terms);
    double missed2 = 0;
    for (int j = 0; j < d; ++j) {
      double missed = -n[K + 1 + j];
      for (int t = 0; t < kTerms; ++t) missed += terms[t] * out[t * d + j];
      missed2 += missed * missed;
    }
    graph.error = std::max(graph.error, std::sqrt(missed2));
  }
}

// Returns by how much a graph may be wrong at |u| = length.
template <int K>
double Surrogate<K>::Doubt(const Graph& graph, double length) const {
  if (graph.scale == 0) return length * length / (2 * step_);
  const double beyond = std::max(1.0, length / graph.scale);
  return graph.error * beyond * beyond * beyond * beyond;
}

template <int K>
void Surrogate<K>::Near::Add(const std::pair<double, std::uint32_t>& candidate) {
  const std::size_t most = points.size();
  std::size_t at = static_cast<std::size_t>(count);
  if (at == most && !(candidate < points[--at])) return;
  for (; at > 0 && candidate < points[at - 1]; --at) points[at] = points[at - 1];
  points[at] = candidate;
  count = std::min(count + 1, static_cast<int>(most));
}

template <int K>
void Surrogate<K>::Near::Close() {
  if (count == kBlended + 1) {
    radius2 = points[kBlended].first;
    --count;
  } else if (count > 0) {
    radius2 = 2 * points[static_cast<std::size_t>(count) - 1].first;
  }
}

// Consecutive points are mostly near each other: one search serves several. The result does not
// depend on where one search ends and the next begins.
template <int K>
std::vector<typename Surrogate<K>::Near> Surrogate<K>::FindNear(
    const Eigen::MatrixXd& points) const {
  const int d = stars_.sample().d();
  const auto count = static_cast<std::size_t>(points.cols());
  const auto at = [&](std::size_t i) { return points.col(static_cast<Eigen::Index>(i)).data(); };
  std::vector<Near> near(count);
  ParallelFor((count + kRun - 1) / kRun, [&](std::size_t run) {
    thread_local std::vector<std::uint32_t> around;
    const double* from = nullptr;  // the centre of the last search
    double radius = 0;             // ... its radius
    for (std::size_t i = run * kRun; i < std::min(count, (run + 1) * kRun); ++i) {
      Near& here = near[i];
      if (from && Distance(at(i), from, d) <= Shared(K) * radius) {
        if (around.empty())
          stars_.sample().ForEachWithin(from, kRoundedUp * (1 + 2 * Shared(K)) * radius,
                                        [&](std::uint32_t p) { around.push_back(p); });
        for (const std::uint32_t p : around)
          here.Add({SquaredDistance(at(i), stars_.sample().Point(p), d), p});
      } else {
        here.count = stars_.sample().Nearest(at(i), kBlended + 1, here.points.data());
        if (here.count == 0) return;
        from = at(i);
        radius = std::sqrt(here.points[static_cast<std::size_t>(here.count) - 1].first);
        around.clear();
      }
    }
    for (std::size_t i = run * kRun; i < std::min(count, (run + 1) * kRun); ++i) near[i].Close();
  });
  return near;
}

template <int K>
void Surrogate<K>::Prepare(const std::vector<Near>& near) {
  std::vector<std::uint32_t> unknown;
  for (std::size_t at = 0; at < near.size(); ++at) {
    CheckInterruption(at);
    const Near& n = near[at];
    for (int i = 0; i < n.count; ++i) {
      const std::uint32_t p = n.points[static_cast<std::size_t>(i)].second;
      if (slot_[p] != kNone) continue;
      slot_[p] = static_cast<std::uint32_t>(graphs_.size() + unknown.size());
      unknown.push_back(p);
    }
  }
  const std::size_t first = graphs_.size();
  graphs_.resize(first + unknown.size());
  forms_.resize(graphs_.size() * form_size_);
  ParallelFor(unknown.size(),
              [&](std::size_t i) { Fit(unknown[i], static_cast<std::uint32_t>(first + i)); });
}

template <int K>
bool Surrogate<K>::Blend(const Near& near, const double* x, double* point, double* tangent,
                         Guess* guess) const {
  const int d = stars_.sample().d();
  thread_local std::vector<double> guesses;
  guesses.resize(static_cast<std::size_t>(d) * kBlended);
  double weights[kBlended];
  double total = 0, doubt = 0, spacing = 0, size = 0;
  std::fill(point, point + d, 0.0);
  int nearest = -1;
  for (int i = 0; i < near.count; ++i) {
    const std::uint32_t p = near.points[static_cast<std::size_t>(i)].second;
    double u[K], v[K], terms[kTerms];
    const double distance2 = stars_.sample().Project(p, x, u);
    double along2 = 0;
    for (int a = 0; a < K; ++a) along2 += u[a] * u[a];
    const double off2 = std::max(distance2 - along2, 0.0);
    weights[i] = 0;
    // Points of another sheet lie across.
    if (distance2 >= near.radius2 || off2 >= along2) continue;
    const double far = 1 - distance2 / near.radius2;
    const double across = 1 - off2 / along2;
    const double weight = far * far * far * across * across;
    const Graph& graph = graphs_[slot_[p]];
    double* y = guesses.data() + i * d;
    stars_.sample().Lift(p, u, y);
    if (graph.scale > 0) {
      for (int a = 0; a < K; ++a) v[a] = u[a] / graph.scale;
      Terms(v, terms);
      const double* form = forms_.data() + slot_[p] * form_size_;
      for (int t = 0; t < kTerms; ++t)
        for (int j = 0; j < d; ++j) y[j] += terms[t] * form[t * d + j];
    }
    weights[i] = weight;
    total += weight;
    doubt += weight * Doubt(graph, std::sqrt(along2));
    spacing += weight * (graph.scale > 0 ? graph.scale : step_);
    if (sizes_) size += weight * sizes_[p];
    for (int j = 0; j < d; ++j) point[j] += weight * y[j];
    if (nearest < 0) nearest = i;
  }
  if (!(total > 0)) return false;
  for (int j = 0; j < d; ++j) point[j] /= total;
  double spread2 = 0;
  for (int i = 0; i < near.count; ++i)
    if (weights[i] > 0) spread2 += weights[i] * SquaredDistance(point, guesses.data() + i * d, d);
  guess->uncertainty = std::max(std::sqrt(spread2 / total), doubt / total);
  guess->spacing = spacing / total;
  guess->size = size / total;
  if (!tangent) return true;

  // The tangents of the nearest graph: T_a + dN / du_a, made orthonormal.
  const std::uint32_t p = near.points[static_cast<std::size_t>(nearest)].second;
  const Graph& graph = graphs_[slot_[p]];
  std::copy_n(stars_.sample().Tangent(p), K * d, tangent);
  if (graph.scale > 0) {
    double u[K], slopes[K][kTerms];
    stars_.sample().Project(p, x, u);
    for (int a = 0; a < K; ++a) u[a] /= graph.scale;
    Slopes(u, slopes);
    const double* form = forms_.data() + slot_[p] * form_size_;
    for (int a = 0; a < K; ++a)
      for (int t = 0; t < kTerms; ++t)
        for (int j = 0; j < d; ++j)
          tangent[a * d + j] += slopes[a][t] / graph.scale * form[t * d + j];
  }
  for (int a = 0; a < K; ++a) {  // Gram and Schmidt, twice for rounding
    double* t = tangent + a * d;
    for (int pass = 0; pass < 2; ++pass)
      for (int b = 0; b < a; ++b) {
        const double s = Dot(t, tangent + b * d, d);
        for (int j = 0; j < d; ++j) t[j] -= s * tangent[b * d + j];
      }
    const double length = std::sqrt(Dot(t, t, d));
    if (!(length > 0)) return false;
    for (int j = 0; j < d; ++j) t[j] /= length;
  }
  return true;
}

template <int K>
bool Surrogate<K>::Predict(const Near& near, const double* x, const double* flat, double spacing,
                           double* point, double* tangent, double* size) const {
  const int d = stars_.sample().d();
  thread_local std::vector<double> from;
  from.resize(static_cast<std::size_t>(d));
  Guess guess;
  // Far from the graphs, each has its own projection of x; near them they can be compared.
  if (!Blend(near, x, point, flat ? nullptr : tangent, &guess)) return false;
  const bool stays = !flat && Distance(x, point, d) <= kNearGuess * guess.spacing;
  std::copy_n(point, d, from.data());
  for (int a = 0; flat && a < K; ++a) {  // back to the flat
    double along = 0;
    const double* t = flat + a * d;
    for (int j = 0; j < d; ++j) along += t[j] * (point[j] - x[j]);
    for (int j = 0; j < d; ++j) from[j] -= along * t[j];
  }
  if (!stays && !Blend(near, from.data(), point, tangent, &guess)) return false;
  *size = guess.size;
  if (spacing < kMargin * epsilon_ && guess.uncertainty > kExact * spacing &&
      guess.spacing > kFine * epsilon_)
    return false;
  return guess.uncertainty <=
         std::max(epsilon_ > 0 ? kSure * guess.spacing : 0, kSureForSpacing * spacing);
}

template <int K>
AnsweredPoints Surrogate<K>::Answer(const Eigen::MatrixXd& points,
                                    const std::vector<const double*>& flats,
                                    const Eigen::VectorXd& spacing) {
  const auto count = static_cast<std::size_t>(points.cols());
  const std::vector<Near> near = FindNear(points);
  Prepare(near);
  AnsweredPoints answer;
  answer.points.setZero(stars_.sample().d(), points.cols());
  answer.tangents.setZero(stars_.sample().d() * K, points.cols());
  answer.found.assign(count, 0);
  Eigen::VectorXd sizes = Eigen::VectorXd::Zero(points.cols());
  ParallelFor(count, [&](std::size_t c) {
    const auto i = static_cast<Eigen::Index>(c);
    answer.found[c] =
        Predict(near[c], points.col(i).data(), flats[c], spacing[i], answer.points.col(i).data(),
                answer.tangents.col(i).data(), &sizes[i]);
  });
  answer.answered = answer.found;
  if (sizes_) answer.sizes = std::move(sizes);
  return answer;
}

STELLATE_INSTANTIATE_CLASS(Surrogate)

}  // namespace stellate::core
