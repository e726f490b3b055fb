#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/certificate/complex/topology.h"
#include "core/certificate/measure/simplex_gram.h"
#include "core/certificate/mesh_view.h"
#include "core/geometry/simplex.h"

namespace stellate::core {

// Extremes of the shapes of a mesh's k-simplices.
struct MeshShape {
  double max_circumradius = 0;  // of a k-simplex, length
  std::uint32_t largest = 0;    // the simplex that has it
  double max_diameter = 0;      // length
  double max_radius_edge = 0;
  double min_fatness = 1;
  double min_angle_degrees = 0;  // k = 2; else 0
  double max_tangent_angle_degrees = 0;

  std::vector<float> diameters;  // by simplex, length
  std::vector<float> tilts;      // by simplex: largest sum of squared sines to a vertex's tangents,
                                 // right to kTiltError or to a float's rounding
};
inline constexpr double kTiltError = 1e-9;

// Finds the extremes in one pass over the stars of a mesh. Gram matrices exclude most simplices;
// one that may be extreme is measured again by its frame, to the last digit. The result does not
// depend on the order.
//
//   search.Measure(s, gram, shortest2, longest2, &worker);  // once for each simplex
//   search.Tilt(s, v, gram, columns, &worker);              // once for each of its vertices
//   MeshShape shape = search.Conclude(extremes);            // of all workers
class ShapeSearch {
 public:
  ShapeSearch(const MeshView& mesh, const SimplexList& list);

  // The extremes of some of the simplices.
  struct Extremes {
    double circumradius = 0, diameter = 0, radius_edge = 0;
    double fatness = std::numeric_limits<double>::infinity();
    float tilt = 0;
    std::uint32_t largest = 0, longest = 0;  // of circumradius and radius-edge, the first
  };
  // Who measures these. Its memory is hundreds of times as large: keep it no longer than that.
  struct Worker {
    Extremes found;
    SimplexFrame frame;
  };

  // Measures a simplex; call it once for each. `gram`: null if it is too ill-conditioned to use.
  // Edges are squared lengths.
  template <int K>
  void Measure(std::uint32_t s, const SimplexGram<K>* gram, double shortest2, double longest2,
               Worker* worker) {
    const double diameter = std::sqrt(longest2);
    worker->found.diameter = std::max(worker->found.diameter, diameter);
    shape_.diameters[s] = static_cast<float>(diameter);
    if (gram && !MayBeExtreme(*gram, shortest2, longest2)) return;
    MeasureByFrame(s, worker);
  }

  // Measures the tilt of a simplex from the tangent space at one of its vertices; call it once for
  // each vertex, from any thread. `gram`: as above. `columns`: the edges of the Gram matrix in
  // tangent coordinates of the vertex.
  template <int K>
  void Tilt(std::uint32_t s, std::uint32_t vertex, const SimplexGram<K>* gram,
            const std::array<const double*, K>& columns, Worker* worker) {
    double tilt = K;
    if (gram) {
      for (int a = 0; a < K; ++a) {
        typename SimplexGram<K>::Row row;
        for (int c = 0; c < K; ++c) row[c] = columns[c][a];
        tilt -= gram->InverseForm(row);
      }
    } else {
      tilt = TiltByFrame(s, vertex, worker);
    }
    const auto rounded = static_cast<float>(tilt);
    worker->found.tilt = std::max(worker->found.tilt, rounded);
    const std::atomic_ref<float> largest(shape_.tilts[s]);
    float known = largest.load(std::memory_order_relaxed);
    while (known < rounded &&
           !largest.compare_exchange_weak(known, rounded, std::memory_order_relaxed)) {
    }
  }

  MeshShape Conclude(const std::vector<Extremes>& parts);

 private:
  static constexpr double kMargin = 1e-6;  // the relative error of Gram matrices

  template <int K>
  bool MayBeExtreme(const SimplexGram<K>& gram, double shortest2, double longest2) const {
    const double radius2 = gram.SquaredCircumradius() * (1 + kMargin);
    double power = longest2, faculty = 1;
    for (int i = 2; i <= K; ++i) {
      power *= longest2;
      faculty *= i;
    }
    return mesh_.protecting_radii2 || radius2 >= radius2_.load(std::memory_order_relaxed) ||
           radius2 >= shortest2 * radius_edge2_.load(std::memory_order_relaxed) ||
           gram.determinant * (1 - kMargin) <=
               faculty * faculty * power * fatness2_.load(std::memory_order_relaxed);
  }
  void MeasureByFrame(std::uint32_t s, Worker* worker);
  double TiltByFrame(std::uint32_t s, std::uint32_t vertex, Worker* worker) const;
  double LargestTilt(std::uint32_t s, Worker* worker) const;
  double MaxSine2(float largest_tilt) const;

  const MeshView& mesh_;
  const SimplexList list_;
  MeshShape shape_;
  // The most extreme ones that some thread has found by now, squared.
  std::atomic<double> radius2_ = 0, radius_edge2_ = 0;
  std::atomic<double> fatness2_ = std::numeric_limits<double>::infinity();
};

}  // namespace stellate::core
