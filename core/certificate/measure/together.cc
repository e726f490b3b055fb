#include "core/certificate/measure/together.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/geometry/simplex.h"
#include "core/geometry/simplex_frame.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

using Small =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDimension + 1, kMaxDimension + 1>;

// Returns the largest cosine of an angle between two facets; 1 for a degenerate simplex. The
// gradients of barycentric coordinates are normal to facets, and the inverse of the edges' Gram
// matrix has their inner products.
double LargestCosine(const MeshView& mesh, int dimension, const std::uint32_t* ids) {
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> edges(mesh.d, dimension);
  const Eigen::Map<const Eigen::VectorXd> first(mesh.Point(ids[0]), mesh.d);
  for (int i = 0; i < dimension; ++i)
    edges.col(i) = Eigen::Map<const Eigen::VectorXd>(mesh.Point(ids[i + 1]), mesh.d) - first;
  const Small gram = edges.transpose() * edges;
  const Eigen::FullPivLU<Small> decomposed(gram);
  if (!decomposed.isInvertible()) return 1;
  Small products(dimension + 1, dimension + 1);
  products.bottomRightCorner(dimension, dimension) = decomposed.inverse();
  for (int i = 1; i <= dimension; ++i) {
    products(i, 0) = -products.row(i).tail(dimension).sum();
    products(0, i) = products(i, 0);
  }
  products(0, 0) = -products.row(0).tail(dimension).sum();
  double largest = -1;
  for (int i = 0; i <= dimension; ++i)
    for (int j = 0; j < i; ++j)
      largest = std::max(largest, -products(i, j) / std::sqrt(products(i, i) * products(j, j)));
  return std::isnan(largest) ? 1 : std::min(largest, 1.0);
}

// Returns the volumes of the simplices from `begin` to `end`, added up in their order. `j`: their
// dimension, two at least, and `d`, constants where that is faster.
[[gnu::always_inline]] inline double AddVolumes(const MeshView& mesh, int j, int d,
                                                const std::uint32_t* begin,
                                                const std::uint32_t* end) {
  SimplexFrame frame;
  frame.directions.resize(static_cast<std::size_t>(j) * static_cast<std::size_t>(d));
  const double* corners[kMaxDimension + 1];
  double sum = 0;
  for (const std::uint32_t* ids = begin; ids != end; ids += j + 1) {
    for (int i = 0; i <= j; ++i)
      corners[i] = mesh.points + std::size_t{ids[i]} * static_cast<std::size_t>(d);
    TakeFrame({corners, static_cast<std::size_t>(j) + 1}, j, d, frame);
    sum += FrameVolume(frame, j);
  }
  return sum;
}

// The same for any dimension.
double VolumeOf(const MeshView& mesh, int dimension, const std::uint32_t* begin,
                const std::uint32_t* end) {
  if (dimension == 0) return static_cast<double>(end - begin);
  if (dimension == 1) {
    double sum = 0;
    for (const std::uint32_t* ids = begin; ids != end; ids += 2)
      sum += Distance(mesh.Point(ids[0]), mesh.Point(ids[1]), mesh.d);
    return sum;
  }
  return WithDimension(mesh.d, [&](auto known) {
    const int d = known() > 0 ? known() : mesh.d;
    return dimension == 2   ? AddVolumes(mesh, 2, d, begin, end)
           : dimension == 3 ? AddVolumes(mesh, 3, d, begin, end)
                            : AddVolumes(mesh, dimension, d, begin, end);
  });
}

Together Measure(const MeshView& mesh, int dimension, const std::vector<std::uint32_t>& simplices,
                 bool with_angles) {
  const auto width = static_cast<std::size_t>(dimension) + 1;
  const std::size_t count = simplices.size() / width;
  struct Part {
    double volume = 0, cosine = -1;
  };
  std::vector<Part> parts(ChunkCount(count));
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    Part part;
    const std::uint32_t* const ids = simplices.data();
    part.volume = VolumeOf(mesh, dimension, ids + begin * width, ids + end * width);
    for (std::size_t s = begin; with_angles && s < end; ++s)
      part.cosine = std::max(part.cosine, LargestCosine(mesh, dimension, ids + s * width));
    parts[chunk] = part;
  });
  Together all;
  double cosine = -1;
  for (const Part& part : parts) {
    all.volume += part.volume;
    cosine = std::max(cosine, part.cosine);
  }
  if (with_angles && count > 0)
    all.min_dihedral_degrees = std::acos(cosine) * 180 / std::numbers::pi;
  return all;
}

}  // namespace

double MeasureVolume(const MeshView& mesh, int dimension,
                     const std::vector<std::uint32_t>& simplices) {
  return Measure(mesh, dimension, simplices, false).volume;
}

Together MeasureTogether(const MeshView& mesh, int dimension,
                         const std::vector<std::uint32_t>& simplices) {
  return Measure(mesh, dimension, simplices, dimension >= 2);
}

double EnclosedVolume(const MeshView& mesh, const std::vector<std::uint32_t>& simplices,
                      const std::vector<bool>& turned) {
  const auto d = static_cast<std::size_t>(mesh.d);
  double sum = 0, faculty = 1;
  for (int i = 2; i <= mesh.d; ++i) faculty *= i;
  if (simplices.empty()) return 0;
  // From a vertex of it: far from the origin the terms would cancel.
  const Eigen::Map<const Eigen::VectorXd> apex(mesh.Point(simplices[0]), mesh.d);
  Small corners(mesh.d, mesh.d);
  for (std::size_t s = 0; s < turned.size(); ++s) {
    for (std::size_t i = 0; i < d; ++i)
      corners.col(static_cast<Eigen::Index>(i)) =
          Eigen::Map<const Eigen::VectorXd>(mesh.Point(simplices[s * d + i]), mesh.d) - apex;
    sum += (turned[s] ? -1 : 1) * corners.determinant();
  }
  return sum / faculty;
}

}  // namespace stellate::core
