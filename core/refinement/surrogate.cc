#include "core/refinement/surrogate.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// A guess is taken when its uncertainty is below this share of the sample's spacing: then its slope
// is about right, and a smooth error of the height moves closest points all alike;
constexpr double kSure = 0.1;
// or below this share of the spacing that the point is for.
constexpr double kSureForSpacing = 0.25;
// Where points shift by a few hundredths of epsilon, many simplices that were to be just smaller
// than epsilon are just larger, and each costs a vertex. So what is not known this well, as a
// share of the spacing, is planned this much coarser at first, unless the sample is so fine, in
// epsilon, that the guesses will not become better.
constexpr double kExact = 0.02;
constexpr double kMargin = 1.15;
constexpr double kFine = 1.6;
// Neighbours whose tangent space is turned further than this are around a corner: |T_p^t T_q| is
// the cosine.
constexpr double kLeastCosine = 0.5;
// Keep the fit determined where neighbours are few; the terms are of order one after scaling.
constexpr double kQuadraticRidge = 1e-6;
constexpr double kCubicRidge = 1e-4;
// What a fit is trusted at best, as a share of the neighbours' distance; and where there are hardly
// more equations than coefficients.
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
Surrogate<K>::Surrogate(const StarComplex<K>& complex, double step, double epsilon,
                        const double* sizes)
    : complex_(complex),
      sizes_(sizes),
      step_(step),
      epsilon_(epsilon),
      form_size_(static_cast<std::size_t>(kTerms) * static_cast<std::size_t>(complex.d())),
      slot_(complex.size(), kNone) {}

template <int K>
void Surrogate<K>::Fit(std::uint32_t p, std::uint32_t slot) {
  using Frame = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, K>>;
  const auto& cell = complex_.cell(p);
  const int d = complex_.d();
  const Frame tangent(complex_.Tangent(p), d, K);
  struct Neighbour {
    double u[K];
    double length;
    Eigen::VectorXd away;                             // q off the tangent plane
    Eigen::Matrix<double, Eigen::Dynamic, K> slopes;  // d of away / d u
  };
  std::vector<Neighbour> neighbours;
  double total = 0;
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    const std::uint32_t neighbour = cell.id(f);
    if (!IsSample(neighbour)) continue;
    const Frame other(complex_.Tangent(neighbour), d, K);
    const Eigen::Matrix<double, K, K> turn = tangent.transpose() * other;
    if (turn.squaredNorm() < K - 1 + kLeastCosine * kLeastCosine) continue;
    Neighbour n;
    complex_.HalfSpace(p, f, n.u);
    double length2 = 0;
    for (const double u : n.u) length2 += u * u;
    const double* q = complex_.Point(neighbour);
    const double* at = complex_.Point(p);
    n.away.resize(d);
    for (int j = 0; j < d; ++j) n.away[j] = q[j] - at[j];
    n.away -= tangent * Eigen::Map<const Eigen::Matrix<double, K, 1>>(n.u);
    if (!(length2 > n.away.squaredNorm())) continue;
    n.length = std::sqrt(length2);
    n.slopes = (other - tangent * turn) * turn.inverse();
    total += n.length;
    neighbours.push_back(std::move(n));
  }
  Graph& graph = graphs_[slot];
  graph = {};
  double* out = forms_.data() + slot * form_size_;
  std::fill(out, out + form_size_, 0.0);
  if (neighbours.size() <= K) return;
  const double scale = total / static_cast<double>(neighbours.size());

  // Sizes known at run time only: unrolled for k = 5 this would be a megabyte of code.
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kTerms, kTerms);
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(kTerms, d);
  Eigen::VectorXd terms(kTerms);
  double slopes[K][kTerms];
  for (const Neighbour& n : neighbours) {
    double v[K];
    for (int a = 0; a < K; ++a) v[a] = n.u[a] / scale;
    // Divided by |u|^2 places, and by |u| slopes, are all of the curvature's size.
    const double weight = scale / n.length;
    Terms(v, terms.data());
    terms *= weight * weight;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(terms);
    rhs.noalias() += terms * ((weight * weight) * n.away.transpose());
    Slopes(v, slopes);
    for (int a = 0; a < K; ++a) {
      terms = Eigen::Map<const Eigen::VectorXd>(slopes[a], kTerms) * weight;
      normal.selfadjointView<Eigen::Lower>().rankUpdate(terms);
      rhs.noalias() += terms * ((weight * scale) * n.slopes.col(a).transpose());
    }
  }
  for (int t = 0; t < kTerms; ++t) normal(t, t) += t < kQuadratic ? kQuadraticRidge : kCubicRidge;
  const Eigen::MatrixXd forms = normal.ldlt().solve(rhs);
  graph.scale = scale;
  const bool scant = static_cast<double>(neighbours.size() * (K + 1)) < 1.5 * kTerms;
  graph.error = (scant ? kScantDoubt : kLeastDoubt) * scale;
  for (const Neighbour& n : neighbours) {
    double v[K];
    for (int a = 0; a < K; ++a) v[a] = n.u[a] / scale;
    Terms(v, terms.data());
    graph.error = std::max(graph.error, (forms.transpose() * terms - n.away).norm());
  }
  for (int t = 0; t < kTerms; ++t)
    for (int j = 0; j < d; ++j) out[t * d + j] = forms(t, j);
}

// By how much a graph may be wrong at |u| = length.
template <int K>
double Surrogate<K>::Doubt(const Graph& graph, double length) const {
  if (graph.scale == 0) return length * length / (2 * step_);
  const double beyond = std::max(1.0, length / graph.scale);
  return graph.error * beyond * beyond * beyond * beyond;
}

template <int K>
typename Surrogate<K>::Near Surrogate<K>::FindNear(const double* x) const {
  Near near;
  near.count = complex_.Nearest(x, kBlended + 1, near.points.data());
  if (near.count == kBlended + 1) {
    near.radius2 = near.points[kBlended].first;
    --near.count;
  } else if (near.count > 0) {
    near.radius2 = 2 * near.points[static_cast<std::size_t>(near.count) - 1].first;
  }
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
  const int d = complex_.d();
  thread_local std::vector<double> guesses;
  guesses.resize(static_cast<std::size_t>(d) * kBlended);
  double weights[kBlended];
  double total = 0, doubt = 0, spacing = 0, size = 0;
  std::fill(point, point + d, 0.0);
  int nearest = -1;
  for (int i = 0; i < near.count; ++i) {
    const std::uint32_t p = near.points[static_cast<std::size_t>(i)].second;
    double u[K], v[K], terms[kTerms];
    const double distance2 = complex_.Project(p, x, u);
    double along2 = 0;
    for (int a = 0; a < K; ++a) along2 += u[a] * u[a];
    const double off2 = std::max(distance2 - along2, 0.0);
    weights[i] = 0;
    // Another sheet's points are across.
    if (distance2 >= near.radius2 || off2 >= along2) continue;
    const double far = 1 - distance2 / near.radius2;
    const double across = 1 - off2 / along2;
    const double weight = far * far * far * across * across;
    const Graph& graph = graphs_[slot_[p]];
    double* y = guesses.data() + i * d;
    complex_.Lift(p, u, y);
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

  // Of the nearest graph: T_a + dN / du_a, made orthonormal.
  const std::uint32_t p = near.points[static_cast<std::size_t>(nearest)].second;
  const Graph& graph = graphs_[slot_[p]];
  std::copy_n(complex_.Tangent(p), K * d, tangent);
  if (graph.scale > 0) {
    double u[K], slopes[K][kTerms];
    complex_.Project(p, x, u);
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
  const int d = complex_.d();
  thread_local std::vector<double> from;
  from.resize(static_cast<std::size_t>(d));
  Guess guess;
  // Off the graphs each sees x elsewhere; near them they can be compared.
  if (!Blend(near, x, point, nullptr, &guess)) return false;
  std::copy_n(point, d, from.data());
  for (int a = 0; flat && a < K; ++a) {  // back to the flat
    double along = 0;
    const double* t = flat + a * d;
    for (int j = 0; j < d; ++j) along += t[j] * (point[j] - x[j]);
    for (int j = 0; j < d; ++j) from[j] -= along * t[j];
  }
  if (!Blend(near, from.data(), point, tangent, &guess)) return false;
  *size = guess.size;
  if (spacing < kMargin * epsilon_ && guess.uncertainty > kExact * spacing &&
      guess.spacing > kFine * epsilon_)
    return false;
  return guess.uncertainty <= std::max(kSure * guess.spacing, kSureForSpacing * spacing);
}

template <int K>
AnsweredPoints Surrogate<K>::Answer(const Eigen::MatrixXd& points,
                                    const std::vector<const double*>& flats,
                                    const Eigen::VectorXd& spacing) {
  const auto count = static_cast<std::size_t>(points.cols());
  std::vector<Near> near(count);
  ParallelFor(count, [&](std::size_t i) {
    near[i] = FindNear(points.col(static_cast<Eigen::Index>(i)).data());
  });
  Prepare(near);
  AnsweredPoints answer;
  answer.points.setZero(complex_.d(), points.cols());
  answer.tangents.setZero(complex_.d() * K, points.cols());
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
