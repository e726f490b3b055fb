#include "core/geometry/common_centre.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/sample/vector_ops.h"

namespace stellate::core {
namespace {

// Cholesky of the Gram matrix of K edges. A pivot below this share of its edge's square is lost in
// rounding: the simplex is flat.
constexpr double kFlat = 1e-14;

template <int K>
bool Factor(double (&gram)[K][K]) {
  for (int c = 0; c < K; ++c) {
    const double whole = gram[c][c];
    for (int j = 0; j < c; ++j) gram[c][c] -= gram[c][j] * gram[c][j];
    if (!(gram[c][c] > kFlat * whole)) return false;
    gram[c][c] = std::sqrt(gram[c][c]);
    for (int r = c + 1; r < K; ++r) {
      for (int j = 0; j < c; ++j) gram[r][c] -= gram[r][j] * gram[c][j];
      gram[r][c] /= gram[c][c];
    }
  }
  return true;
}

template <int K>
void Substitute(const double (&factor)[K][K], double* x) {
  for (int r = 0; r < K; ++r) {
    for (int j = 0; j < r; ++j) x[r] -= factor[r][j] * x[j];
    x[r] /= factor[r][r];
  }
  for (int r = K - 1; r >= 0; --r) {
    for (int j = r + 1; j < K; ++j) x[r] -= factor[j][r] * x[j];
    x[r] /= factor[r][r];
  }
}

}  // namespace

template <int K>
bool CommonCentre(int d, const double* const* points, const double* const* tangents,
                  const double* weights, double* centre, double* radius2) {
  const auto n = static_cast<std::size_t>(d);
  thread_local std::vector<double> memory;
  memory.resize(n * (K + 2));
  double* edge[K];  // v_i - v_0
  for (int i = 0; i < K; ++i) {
    edge[i] = memory.data() + static_cast<std::size_t>(i) * n;
    for (int j = 0; j < d; ++j) edge[i][j] = points[i + 1][j] - points[0][j];
  }
  double* lift = memory.data() + K * n;
  double* away = lift + n;

  double gram[K][K], barycentric[K];
  for (int r = 0; r < K; ++r)
    for (int c = 0; c <= r; ++c) gram[r][c] = Dot(edge[r], edge[c], d);
  for (int r = 0; r < K; ++r)
    barycentric[r] = 0.5 * (gram[r][r] + weights[0] - weights[r + 1]);
  if (!Factor<K>(gram)) return false;
  Substitute<K>(gram, barycentric);  // x = v_0 + sum barycentric_i edge_i

  std::fill(centre, centre + d, 0.0);
  double first = 1;
  for (int i = 0; i < K; ++i) {
    first -= barycentric[i];
    for (int j = 0; j < d; ++j) centre[j] += barycentric[i] * edge[i][j];
  }
  *radius2 = Dot(centre, centre, d);

  std::fill(lift, lift + d, 0.0);
  for (int i = 0; i <= K; ++i) {
    const double b = 0.5 * (i == 0 ? first : barycentric[i - 1]);
    for (int j = 0; j < d; ++j) away[j] = centre[j] - (i == 0 ? 0.0 : edge[i - 1][j]);
    for (int a = 0; a < K; ++a) {
      const double* t = tangents[i] + a * d;
      const double s = b * Dot(t, away, d);
      for (int j = 0; j < d; ++j) lift[j] += s * t[j];
    }
  }
  // Off what lies along the simplex, so that the distances to its vertices stay equal.
  double along[K];
  for (int i = 0; i < K; ++i) along[i] = Dot(edge[i], lift, d);
  Substitute<K>(gram, along);
  for (int i = 0; i < K; ++i)
    for (int j = 0; j < d; ++j) lift[j] -= along[i] * edge[i][j];
  for (int j = 0; j < d; ++j) centre[j] += lift[j];
  return true;
}

template bool CommonCentre<1>(int, const double* const*, const double* const*, const double*,
                              double*, double*);
template bool CommonCentre<2>(int, const double* const*, const double* const*, const double*,
                              double*, double*);
template bool CommonCentre<3>(int, const double* const*, const double* const*, const double*,
                              double*, double*);
template bool CommonCentre<4>(int, const double* const*, const double* const*, const double*,
                              double*, double*);
template bool CommonCentre<5>(int, const double* const*, const double* const*, const double*,
                              double*, double*);

}  // namespace stellate::core
