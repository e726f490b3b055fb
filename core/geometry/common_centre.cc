#include "core/geometry/common_centre.h"

#include <algorithm>
#include <array>
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

// Room for `count` vectors of R^d, D = d where that is known early: on the stack then.
template <int D, int count>
class Vectors {
 public:
  explicit Vectors(int) {}
  double* operator[](int i) { return memory_.data() + i * D; }

 private:
  std::array<double, D * count> memory_;
};

template <int count>
class Vectors<0, count> {
 public:
  explicit Vectors(int d) : d_(d) { Memory().resize(static_cast<std::size_t>(d * count)); }
  double* operator[](int i) { return Memory().data() + i * d_; }

 private:
  static std::vector<double>& Memory() {
    thread_local std::vector<double> memory;
    return memory;
  }
  int d_;
};

// D: d, or 0 for any. Known early, the short loops unroll.
template <int K, int D>
bool CentreOf(int any_d, const double* const* points, const double* const* tangents,
              const double* weights, double* centre, double* radius2) {
  const int d = D > 0 ? D : any_d;
  Vectors<D, K + 2> memory(d);
  double* edge[K];  // v_i - v_0
  for (int i = 0; i < K; ++i) {
    edge[i] = memory[i];
    for (int j = 0; j < d; ++j) edge[i][j] = points[i + 1][j] - points[0][j];
  }
  double* const lift = memory[K];
  double* const away = memory[K + 1];

  double gram[K][K], barycentric[K];
  for (int r = 0; r < K; ++r)
    for (int c = 0; c <= r; ++c) gram[r][c] = Dot(edge[r], edge[c], d);
  for (int r = 0; r < K; ++r) barycentric[r] = 0.5 * (gram[r][r] + weights[0] - weights[r + 1]);
  if (!Factor<K>(gram)) return false;
  Substitute<K>(gram, barycentric);  // x = v_0 + sum barycentric_i edge_i

  for (int j = 0; j < d; ++j) centre[j] = 0;
  double first = 1;
  for (int i = 0; i < K; ++i) {
    first -= barycentric[i];
    for (int j = 0; j < d; ++j) centre[j] += barycentric[i] * edge[i][j];
  }
  *radius2 = Dot(centre, centre, d);

  for (int j = 0; j < d; ++j) lift[j] = 0;
  for (int i = 0; i <= K; ++i) {
    const double b = 0.5 * (i == 0 ? first : barycentric[i - 1]);
    for (int j = 0; j < d; ++j) away[j] = i == 0 ? centre[j] : centre[j] - edge[i - 1][j];
    for (int a = 0; a < K; ++a) {
      const double* const t = tangents[i] + a * d;
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

}  // namespace

template <int K>
bool CommonCentre(int d, const double* const* points, const double* const* tangents,
                  const double* weights, double* centre, double* radius2) {
  switch (d) {
#define STELLATE_CASE(D) \
  case D:                \
    return CentreOf<K, D>(d, points, tangents, weights, centre, radius2);
    STELLATE_CASE(3)
    STELLATE_CASE(4)
    STELLATE_CASE(5)
    STELLATE_CASE(6)
    STELLATE_CASE(7)
    STELLATE_CASE(8)
    STELLATE_CASE(9)
    STELLATE_CASE(10)
#undef STELLATE_CASE
    default:
      return CentreOf<K, 0>(d, points, tangents, weights, centre, radius2);
  }
}

#define STELLATE_INSTANTIATE(K)                                                                 \
  template bool CommonCentre<K>(int, const double* const*, const double* const*, const double*, \
                                double*, double*);
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
