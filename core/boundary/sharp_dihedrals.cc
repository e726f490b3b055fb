#include "core/boundary/sharp_dihedrals.h"

#include <cmath>

#include "core/base/instantiate.h"
#include "core/base/vector_ops.h"
#include "core/boundary/sharp_edges.h"

namespace stellate::core {
namespace {

// Whether two points are on an edge where walls meet at an angle whose cosine is larger.
template <int K>
bool MeetAsSharply(const Stars<K>& stars, std::uint32_t a, std::uint32_t b, double cosine) {
  if (CountWalls(stars.sample().walls(a) & stars.sample().walls(b)) < 2) return false;
  const auto angle = SharpestAt<K>(stars, a);
  return angle && angle->cosine > cosine;
}

// The least of 0 to 3 that is neither.
int LeastOther(int a, int b) {
  int other = 0;
  while (other == a || other == b) ++other;
  return other;
}

}  // namespace

// A facet's inner normal is the gradient of the barycentric coordinate of the vertex off it. Up to
// one factor, the gradients' inner products are the minors of the edges' inner products.
template <int K>
bool HasSharpDihedral(const Stars<K>& stars, std::uint32_t p, const double* at,
                      const RestrictedVoronoiCell<K>& cell, std::size_t v, double cosine,
                      const double* unborn) {
  if constexpr (K == 3) {
    const int d = stars.sample().d();
    std::uint32_t ids[4] = {p};
    const double* q[3];
    for (int a = 0; a < 3; ++a) {
      ids[a + 1] = cell.id(cell.facet(v, a));
      q[a] = ids[a + 1] < stars.size() ? stars.sample().Point(ids[a + 1]) : unborn;
    }
    double gram[3][3];
    WithDimension(d, [&](auto known) {
      const int n = known() > 0 ? known() : d;
      for (int a = 0; a < 3; ++a) gram[a][a] = SquaredDistance(at, q[a], n);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < a; ++b)
          gram[a][b] = gram[b][a] =
              0.5 * (gram[a][a] + gram[b][b] - SquaredDistance(q[a], q[b], n));
    });
    const auto minor = [&](int a1, int a2, int b1, int b2) {
      return gram[a1][b1] * gram[a2][b2] - gram[a1][b2] * gram[a2][b1];
    };
    const double xx = minor(1, 2, 1, 2), xy = minor(1, 2, 2, 0), xz = minor(1, 2, 0, 1);
    const double yy = minor(2, 0, 2, 0), yz = minor(2, 0, 0, 1), zz = minor(0, 1, 0, 1);
    const double inner[4][4] = {
        // of the gradients: p's, and the others'
        {xx + xy + xz + xy + yy + yz + xz + yz + zz, -xx - xy - xz, -xy - yy - yz, -xz - yz - zz},
        {0, xx, xy, xz},
        {0, 0, yy, yz},
        {0, 0, 0, zz}};
    for (int a = 0; a < 4; ++a)
      for (int b = a + 1; b < 4; ++b) {
        // Inside of the tetrahedron: that of the normals is its opposite.
        const bool is_acute = inner[a][b] < 0;
        if (!is_acute || inner[a][b] * inner[a][b] <= cosine * cosine * inner[a][a] * inner[b][b])
          continue;
        const int c = LeastOther(a, b);
        if (!MeetAsSharply<K>(stars, ids[c], ids[6 - a - b - c], cosine)) return true;
      }
  }
  return false;
}

template <int K>
std::optional<std::size_t> WorstSharp(const Stars<K>& stars, std::uint32_t p, double cosine,
                                      double least_radius, int sector) {
  const auto& cell = stars.cell(p, sector);
  const auto is_held = [&](std::size_t v) {
    for (int s = 0; s < K; ++s)
      if (const std::uint32_t id = cell.id(cell.facet(v, s)); id < p || !IsSample(id)) return false;
    return true;
  };
  std::optional<std::size_t> worst;
  double most2 = least_radius * least_radius;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    if (cell.norm2(v) <= most2 || !is_held(v) ||
        !HasSharpDihedral<K>(stars, p, stars.sample().Point(p), cell, v, cosine, nullptr))
      continue;
    worst = v;
    most2 = cell.norm2(v);
  }
  return worst;
}

#define STELLATE_EACH(K)                                                                    \
  template bool HasSharpDihedral<K>(const Stars<K>&, std::uint32_t, const double*,          \
                                    const RestrictedVoronoiCell<K>&, std::size_t, double,   \
                                    const double*);                                         \
  template std::optional<std::size_t> WorstSharp<K>(const Stars<K>&, std::uint32_t, double, \
                                                    double, int);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
