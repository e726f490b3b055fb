#include "core/geometry/common_centre.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/vector_ops.h"
#include "core/geometry/half_spaces.h"

namespace stellate::core {
namespace {

// Cholesky of the Gram matrix of K edges. A pivot below this share of its edge's square is lost in
// rounding: the simplex is flat.
constexpr double kFlatGram = 1e-14;

template <int K>
bool Factor(double (&gram)[K][K]) {
  for (int c = 0; c < K; ++c) {
    const double whole = gram[c][c];
    for (int j = 0; j < c; ++j) gram[c][c] -= gram[c][j] * gram[c][j];
    if (!(gram[c][c] > kFlatGram * whole)) return false;
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

// Memory of `count` vectors of R^d: on the stack if the compiler knows D = d.
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
  explicit Vectors(int d) : d_(d) { Memory().resize(static_cast<std::size_t>(d) * count); }
  double* operator[](int i) { return Memory().data() + i * d_; }

 private:
  static std::vector<double>& Memory() {
    thread_local std::vector<double> memory;
    return memory;
  }
  int d_;
};

// An orthonormal basis of the mean of the tangent spaces, sum_i b_i P_i, the steps of a power
// iteration from that of the heaviest vertex: K rows of d. False if they have no such mean.
constexpr int kMeanSteps = 2;  // each leaves of the error about the squared sine of the turn
// The weights of thin simplices have no bound, and far below zero a vertex would push the mean away
// from its own tangent space. Found by trial, as kMostTurned.
constexpr double kLeastWeight = -0.25;
template <int K>
bool MeanTangent(int d, const double* const* tangents, const double* barycentric, double* mean,
                 double* next) {
  const int heaviest =
      static_cast<int>(std::max_element(barycentric, barycentric + K + 1) - barycentric);
  double weight[K + 1];
  for (int i = 0; i <= K; ++i) weight[i] = std::max(barycentric[i], kLeastWeight);
  std::copy_n(tangents[heaviest], K * d, mean);
  for (int step = 0; step < kMeanSteps; ++step) {
    for (int a = 0; a < K; ++a) {
      double* const row = next + a * d;
      std::fill(row, row + d, 0.0);
      for (int i = 0; i <= K; ++i)
        for (int b = 0; b < K; ++b) {
          const double* const t = tangents[i] + b * d;
          const double s = weight[i] * Dot(t, mean + a * d, d);
          for (int j = 0; j < d; ++j) row[j] += s * t[j];
        }
      for (int b = 0; b < a; ++b) {
        const double s = Dot(row, next + b * d, d);
        for (int j = 0; j < d; ++j) row[j] -= s * next[b * d + j];
      }
      const double length = std::sqrt(Dot(row, row, d));
      if (!(length > kFlatGram)) return false;
      for (int j = 0; j < d; ++j) row[j] /= length;
    }
    std::copy_n(next, K * d, mean);
  }
  return true;
}

// From v_i to c the tangent space turns: with A = Tm T_i^t between the mean tangent space's basis
// and v_i's, and C = A A^t (squared cosines), the lift is T_i^t A^t f(C) w, w the tangent
// coordinates of x - v_i, f(c) = 1 / (c + sqrt c): exact where curvature is constant, as on spheres
// and products of circles. f is taken as (11 + c) / (4 + 20 c), right to second order at c = 1 and
// to 1 % for turns up to 45 degrees. Returns false for larger turns, where the lift is unreliable.
// The bound, on the sum of squared sines, was found by trial on T^4 in R^8 at 0.8 of its reach:
// larger ones misjudge steep simplices, and inconsistencies spread over the whole mesh.
constexpr double kMostTurned = 0.75;
template <int K>
bool AddTurnedLift(int d, const double* tangent, const double* mean, double b, const double* away,
                   double* lift) {
  double a_rows[K][K], c[K][K], w[K], z[K];
  for (int r = 0; r < K; ++r) {
    w[r] = Dot(mean + r * d, away, d);
    for (int s = 0; s < K; ++s) a_rows[r][s] = Dot(mean + r * d, tangent + s * d, d);
  }
  double system[K][K + 1];
  for (int r = 0; r < K; ++r) {
    for (int s = 0; s < K; ++s) {
      c[r][s] = Dot(a_rows[r], a_rows[s], K);
      system[r][s] = 20 * c[r][s] + (r == s ? 4 : 0);
    }
    system[r][K] = w[r];
  }
  double turn = K;  // sum of squared sines
  for (int r = 0; r < K; ++r) turn -= c[r][r];
  if (turn > kMostTurned || !SolveSquare<K>(system, z)) return false;
  double f[K];
  for (int r = 0; r < K; ++r) f[r] = 11 * z[r] + Dot(c[r], z, K);
  for (int s = 0; s < K; ++s) {
    double along = 0;
    for (int r = 0; r < K; ++r) along += a_rows[r][s] * f[r];
    for (int j = 0; j < d; ++j) lift[j] += b * along * tangent[s * d + j];
  }
  return true;
}

// Removes the part along the simplex, so that distances to its vertices stay equal. d: a constant
// where that is faster.
template <int K>
[[gnu::always_inline]] inline void DropAlong(int d, const double* const* edge,
                                             const double (&factor)[K][K], double* x) {
  double along[K];
  for (int i = 0; i < K; ++i) along[i] = Dot(edge[i], x, d);
  Substitute<K>(factor, along);
  for (int i = 0; i < K; ++i)
    for (int j = 0; j < d; ++j) x[j] -= along[i] * edge[i][j];
}

// Enough for simplices along the tangent spaces, where each turn leaves a small share of the gap.
constexpr int kTurnsToHeight = 5;

// Computes the centre for simplices that are large compared with the reach. `away` holds d numbers,
// `rows` 2 K d.
template <int K>
bool TurnedLift(int d, const double* const* tangents, const double* const* edge,
                const double (&factor)[K][K], const double* barycentric, const double* centre,
                double* away, double* rows, double* lift) {
  double* const mean = rows;
  if (!MeanTangent<K>(d, tangents, barycentric, mean, rows + K * d)) return false;
  std::fill(lift, lift + d, 0.0);
  for (int i = 0; i <= K; ++i) {
    for (int j = 0; j < d; ++j) away[j] = i == 0 ? centre[j] : centre[j] - edge[i - 1][j];
    if (!AddTurnedLift<K>(d, tangents[i], mean, barycentric[i], away, lift)) return false;
  }
  // Only the part of the lift normal to the mean tangent space counts.
  const auto drop_tangential = [&](double* x) {
    for (int a = 0; a < K; ++a) {
      const double s = Dot(mean + a * d, x, d);
      for (int j = 0; j < d; ++j) x[j] -= s * mean[a * d + j];
    }
  };
  drop_tangential(lift);
  // Moves by turns towards the point at that height that is equidistant from the vertices. For a
  // simplex that stands off the tangent spaces that point is far away, where none of this holds,
  // and the moves stop before it.
  double* const wanted = rows + K * d;
  double* const gap = wanted + d;
  std::copy_n(lift, d, wanted);
  DropAlong<K>(d, edge, factor, lift);
  for (int turn = 1; turn < kTurnsToHeight; ++turn) {
    for (int j = 0; j < d; ++j) gap[j] = wanted[j] - lift[j];
    drop_tangential(gap);
    DropAlong<K>(d, edge, factor, gap);
    for (int j = 0; j < d; ++j) lift[j] += gap[j];
  }
  return true;
}

// Whether the first lift would leave too many simplices inconsistent, because they are large
// compared with the reach. From K = 4 on they all are, at affordable sizes; for K = 3 those that M
// bends away from by more than this share of the circumradius, half its ratio to the reach.
constexpr int kTurns = 3;
constexpr double kBent = 0.15;
template <int K>
bool IsLarge(double lift2, double radius2) {
  return K > kTurns || (K == kTurns && lift2 > kBent * kBent * radius2);
}

// D: d, or 0 for any d. If D is known at compile time the short loops unroll.
template <int K, int D>
bool CentreOf(int any_d, const double* const* points, const double* const* tangents,
              const double* weights, double most2, double* centre) {
  const int d = D > 0 ? D : any_d;
  Vectors<D, K + 2 + (K >= kTurns ? 1 + 2 * K : 0)> memory(d);
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
  for (int r = 0; r < K; ++r)
    if (gram[r][r] > 4 * most2) return false;  // no chord is longer than the diameter
  for (int r = 0; r < K; ++r) barycentric[r] = 0.5 * (gram[r][r] + weights[0] - weights[r + 1]);
  if (!Factor<K>(gram)) return false;
  Substitute<K>(gram, barycentric);  // x = v_0 + sum barycentric_i edge_i

  for (int j = 0; j < d; ++j) centre[j] = 0;
  double first = 1;
  for (int i = 0; i < K; ++i) {
    first -= barycentric[i];
    for (int j = 0; j < d; ++j) centre[j] += barycentric[i] * edge[i][j];
  }
  const double radius2 = Dot(centre, centre, d);
  if (radius2 > most2) return false;

  double b[K + 1];
  b[0] = first;
  std::copy_n(barycentric, K, b + 1);
  std::fill(lift, lift + d, 0.0);
  for (int i = 0; i <= K; ++i) {
    for (int j = 0; j < d; ++j) away[j] = i == 0 ? centre[j] : centre[j] - edge[i - 1][j];
    for (int a = 0; a < K; ++a) {
      const double* const t = tangents[i] + a * d;
      const double s = 0.5 * b[i] * Dot(t, away, d);
      for (int j = 0; j < d; ++j) lift[j] += s * t[j];
    }
  }
  DropAlong<K>(d, edge, gram, lift);
  if constexpr (K >= kTurns) {
    double* const turned = memory[K + 2];
    if (IsLarge<K>(Dot(lift, lift, d), radius2) &&
        TurnedLift<K>(d, tangents, edge, gram, b, centre, away, memory[K + 3], turned))
      std::copy_n(turned, d, lift);
  }
  for (int j = 0; j < d; ++j) centre[j] += lift[j];
  return true;
}

}  // namespace

template <int K>
bool CommonCentre(int d, const double* const* points, const double* const* tangents,
                  const double* weights, double most2, double* centre) {
  return WithDimension(d, [&](auto known) {
    return CentreOf<K, known()>(d, points, tangents, weights, most2, centre);
  });
}

#define STELLATE_EACH(K)                                                                        \
  template bool CommonCentre<K>(int, const double* const*, const double* const*, const double*, \
                                double, double*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
