#include "core/geometry/surroundings.h"

#include <cmath>

#include "core/base/instantiate.h"

namespace stellate::core {

template <int K>
double FakeHalfSpace(int i, double inradius, double* normal) {
  // Unit normals of all facets, one coordinate at a time: all pairwise dot products -1/K.
  double n[K + 1][K] = {};
  for (int a = 0; a < K; ++a) {
    double rest = 1;
    for (int b = 0; b < a; ++b) rest -= n[a][b] * n[a][b];
    n[a][a] = std::sqrt(rest);
    for (int j = a + 1; j <= K; ++j) {
      double s = -1.0 / K;
      for (int b = 0; b < a; ++b) s -= n[a][b] * n[j][b];
      n[j][a] = s / n[a][a];
    }
  }
  for (int a = 0; a < K; ++a) normal[a] = n[i][a] * inradius;
  return inradius * inradius;
}

template double FakeHalfSpace<1>(int, double, double*);
template double FakeHalfSpace<2>(int, double, double*);
template double FakeHalfSpace<3>(int, double, double*);
template double FakeHalfSpace<4>(int, double, double*);
STELLATE_ABOVE_3(template double FakeHalfSpace<5>(int, double, double*);)

}  // namespace stellate::core
