#include "core/refinement/surrogate.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace stellate::core {
namespace {

// Quadrics are trusted as far as two of them agree, as a share of the distance to their points.
constexpr double kDisagreement = 0.3;
// Neighbours whose tangent space is turned further than this are around a corner: |T_p^t T_q| is
// the cosine.
constexpr double kLeastCosine = 0.5;
// Keeps the fit determined where neighbours are few; the terms are of order one after scaling.
constexpr double kRidge = 1e-3;
constexpr int kBlended = 3;
// A quadric that misses its own neighbours by this share of their distance is none of M: the sample
// is too coarse there.
constexpr double kMostResidual = 0.1;

// u_a u_b for a <= b; the diagonal halved, so that II(u, u) / 2 is the sum of term times form.
template <int K>
void Terms(const double* u, double* terms) {
  for (int a = 0, t = 0; a < K; ++a)
    for (int b = a; b < K; ++b) terms[t++] = (a == b ? 0.5 : 1.0) * u[a] * u[b];
}

}  // namespace

template <int K>
Surrogate<K>::Surrogate(const StarComplex<K>& complex)
    : complex_(complex),
      form_size_(static_cast<std::size_t>(kTerms) * static_cast<std::size_t>(complex.d())),
      forms_(complex.size() * form_size_),
      fitted_(complex.size()) {
  ParallelFor(complex.size(), [this](std::uint32_t p) { Fit(p); });
}

template <int K>
void Surrogate<K>::Fit(std::uint32_t p) {
  const auto& cell = complex_.cell(p);
  const int d = complex_.d();
  if (!cell.bounded()) return;
  Eigen::Matrix<double, kTerms, kTerms> normal = Eigen::Matrix<double, kTerms, kTerms>::Zero();
  Eigen::Matrix<double, kTerms, Eigen::Dynamic> rhs(kTerms, d);
  rhs.setZero();
  const double* tangent = complex_.Tangent(p);
  Eigen::VectorXd away(d);
  struct Equation {
    Eigen::Matrix<double, kTerms, 1> terms;
    Eigen::VectorXd away;
    double length;
  };
  std::vector<Equation> equations;
  for (const auto& facet : cell.facets()) {
    const double* q = complex_.Point(facet.id);
    double turned = 0;
    for (int a = 0; a < K; ++a)
      for (int b = 0; b < K; ++b) {
        const double c = Dot(tangent + a * d, complex_.Tangent(facet.id) + b * d, d);
        turned += c * c;
      }
    if (turned < K - 1 + kLeastCosine * kLeastCosine) continue;
    double length2 = 0;
    for (int a = 0; a < K; ++a) length2 += facet.normal[a] * facet.normal[a];
    if (!(length2 > 0)) continue;
    for (int j = 0; j < d; ++j) {
      away[j] = q[j] - complex_.Point(p)[j];
      for (int a = 0; a < K; ++a) away[j] -= facet.normal[a] * tangent[a * d + j];
    }
    // Divided by |u|^2 the equations are all of the curvature's size.
    Eigen::Matrix<double, kTerms, 1> terms;
    Terms<K>(facet.normal, terms.data());
    terms /= length2;
    away /= length2;
    normal += terms * terms.transpose();
    rhs += terms * away.transpose();
    equations.push_back({terms, away, std::sqrt(length2)});
  }
  if (equations.size() < kTerms) return;
  normal.diagonal().array() += kRidge;
  const Eigen::Matrix<double, kTerms, Eigen::Dynamic> forms = normal.ldlt().solve(rhs);
  for (int t = 0; t < kTerms; ++t)
    for (int j = 0; j < d; ++j) forms_[p * form_size_ + static_cast<std::size_t>(t * d + j)] = forms(t, j);
  for (const Equation& e : equations)
    if ((forms.transpose() * e.terms - e.away).norm() * e.length > kMostResidual) return;
  fitted_[p] = 1;
}

template <int K>
bool Surrogate<K>::Predict(const double* x, double* point, double* tangent) const {
  const int d = complex_.d();
  std::array<std::pair<double, std::uint32_t>, kBlended> nearest;
  const int found = complex_.Nearest(x, kBlended, nearest.data());
  if (found == 0) return false;
  std::fill(point, point + d, 0.0);
  std::fill(tangent, tangent + K * d, 0.0);
  thread_local std::vector<double> guesses;
  guesses.resize(static_cast<std::size_t>(found * d));
  double total = 0;
  for (int i = 0; i < found; ++i) {
    const std::uint32_t p = nearest[static_cast<std::size_t>(i)].second;
    if (!fitted_[p]) return false;
    double u[K], terms[kTerms];
    complex_.Project(p, x, u);
    Terms<K>(u, terms);
    double* guess = guesses.data() + i * d;
    complex_.Lift(p, u, guess);
    for (int t = 0; t < kTerms; ++t)
      for (int j = 0; j < d; ++j) guess[j] += terms[t] * Form(p)[t * d + j];
    const double weight =
        1 / (nearest[static_cast<std::size_t>(i)].first + std::numeric_limits<double>::min());
    total += weight;
    for (int j = 0; j < d; ++j) point[j] += weight * guess[j];
    if (i > 0) continue;
    // Tangents from the nearest quadric: T_a + sum_b II(e_a, e_b) u_b.
    std::copy_n(complex_.Tangent(p), K * d, tangent);
    for (int a = 0, t = 0; a < K; ++a)
      for (int b = a; b < K; ++b, ++t)
        for (int j = 0; j < d; ++j) {
          tangent[a * d + j] += Form(p)[t * d + j] * u[b];
          if (a != b) tangent[b * d + j] += Form(p)[t * d + j] * u[a];
        }
  }
  for (int j = 0; j < d; ++j) point[j] /= total;
  for (int i = 0; i < found; ++i) {
    const double from = std::sqrt(nearest[static_cast<std::size_t>(i)].first);
    if (Distance(point, guesses.data() + i * d, d) > kDisagreement * from) return false;
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
AnswerBlock Surrogate<K>::Answer(const QueryBlock& block) const {
  const int d = complex_.d();
  AnswerBlock answer;
  answer.points.resize(d, block.size());
  answer.tangents.setZero(d * K, block.size());
  answer.found.assign(static_cast<std::size_t>(block.size()), 0);
  ParallelFor(block.size(), [&](Eigen::Index i) {
    thread_local std::vector<double> tangent;
    tangent.resize(static_cast<std::size_t>(K * d));
    const bool ok = Predict(block.points.col(i).data(), answer.points.col(i).data(), tangent.data());
    answer.found[static_cast<std::size_t>(i)] = ok;
    for (int j = 0; ok && j < d; ++j)
      for (int a = 0; a < K; ++a)
        answer.tangents(j * K + a, i) = tangent[static_cast<std::size_t>(a * d + j)];
  });
  return answer;
}

template class Surrogate<1>;
template class Surrogate<2>;
template class Surrogate<3>;
template class Surrogate<4>;
template class Surrogate<5>;

}  // namespace stellate::core
