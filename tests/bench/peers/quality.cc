#include "tests/bench/peers/quality.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace stellate::bench {
namespace {

constexpr std::size_t kMaxCorners = 6;
using Face = std::array<std::uint32_t, kMaxCorners>;  // ascending, padded with the largest number
constexpr std::uint32_t kNone = ~0u;

// All faces with `size` corners, sorted, one entry for each simplex that has it.
std::vector<Face> Faces(const std::vector<std::uint32_t>& simplices, std::size_t corners,
                        int size) {
  std::vector<Face> faces;
  std::vector<std::uint32_t> simplex(corners);
  for (std::size_t begin = 0; begin < simplices.size(); begin += corners) {
    std::copy_n(simplices.begin() + static_cast<std::ptrdiff_t>(begin), corners, simplex.begin());
    std::sort(simplex.begin(), simplex.end());
    for (unsigned subset = 1; subset < 1u << corners; ++subset) {
      if (__builtin_popcount(subset) != size) continue;
      Face face;
      face.fill(kNone);
      std::size_t count = 0;
      for (std::size_t i = 0; i < corners; ++i) {
        if ((subset >> i & 1u) != 0) face[count++] = simplex[i];
      }
      faces.push_back(face);
    }
  }
  std::sort(faces.begin(), faces.end());
  return faces;
}

// Whether each entry of a sorted list stands there exactly twice.
bool AllTwice(const std::vector<Face>& faces) {
  for (std::size_t i = 0; i < faces.size(); i += 2) {
    if (i + 1 == faces.size() || faces[i] != faces[i + 1]) return false;
    if (i + 2 < faces.size() && faces[i] == faces[i + 2]) return false;
  }
  return true;
}

// Of a sorted list, what stands there once.
std::vector<Face> Once(const std::vector<Face>& faces) {
  std::vector<Face> once;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const bool before = i > 0 && faces[i] == faces[i - 1];
    const bool after = i + 1 < faces.size() && faces[i] == faces[i + 1];
    if (!before && !after) once.push_back(faces[i]);
  }
  return once;
}

// Whether no entry of a sorted list stands there more than twice, and those that stand there once,
// with `size` corners each, are a closed complex that is not empty.
bool EndInAClosedOne(const std::vector<Face>& faces, std::size_t size) {
  for (std::size_t i = 2; i < faces.size(); ++i)
    if (faces[i] == faces[i - 2]) return false;
  std::vector<std::uint32_t> rim;
  for (const Face& face : Once(faces))
    rim.insert(rim.end(), face.begin(), face.begin() + static_cast<std::ptrdiff_t>(size));
  return !rim.empty() && AllTwice(Faces(rim, size, static_cast<int>(size) - 1));
}

// Largest distance of the faces' vertices and barycentres from a half-space's end.
double FarthestFromEnd(const Eigen::VectorXd& pole, double clip, const Eigen::MatrixXd& points,
                       const std::vector<Face>& faces, std::size_t size) {
  double farthest = 0;
  for (const Face& face : faces) {
    double middle = 0;
    for (std::size_t i = 0; i < size; ++i) {
      const double off = pole.dot(points.col(face[i]).head(pole.size())) - clip;
      farthest = std::max(farthest, std::abs(off));
      middle += off / static_cast<double>(size);
    }
    farthest = std::max(farthest, std::abs(middle));
  }
  return farthest;
}

// Largest distance of the faces' barycentres from M, in batches.
double FarthestBarycentre(Manifold& manifold, const Eigen::MatrixXd& points,
                          const std::vector<Face>& faces, int size) {
  constexpr std::size_t kBatch = 4096;
  const Eigen::Index inner = manifold.ambient_dimension();
  double farthest = 0;
  for (std::size_t begin = 0; begin < faces.size(); begin += kBatch) {
    const std::size_t count = std::min(kBatch, faces.size() - begin);
    Eigen::MatrixXd barycentres =
        Eigen::MatrixXd::Zero(points.rows(), static_cast<Eigen::Index>(count));
    for (std::size_t j = 0; j < count; ++j) {
      for (int i = 0; i < size; ++i) {
        barycentres.col(static_cast<Eigen::Index>(j)) +=
            points.col(faces[begin + j][static_cast<std::size_t>(i)]) / size;
      }
    }
    const Eigen::ArrayXd within = manifold.Distance(barycentres.topRows(inner)).array();
    const Eigen::ArrayXd beside =
        barycentres.bottomRows(points.rows() - inner).colwise().squaredNorm().transpose().array();
    farthest = std::max(farthest, (within.square() + beside).sqrt().maxCoeff());
  }
  return farthest;
}

// vol_j / diam^j of the j-simplex on the columns.
double Fatness(const Eigen::MatrixXd& corners) {
  const Eigen::Index j = corners.cols() - 1;
  double diameter = 0;
  for (Eigen::Index a = 0; a < j; ++a) {
    for (Eigen::Index b = a + 1; b <= j; ++b) {
      diameter = std::max(diameter, (corners.col(a) - corners.col(b)).norm());
    }
  }
  const Eigen::MatrixXd edges = corners.rightCols(j).colwise() - corners.col(0);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(edges / diameter);
  return qr.matrixR().topLeftCorner(j, j).diagonal().cwiseAbs().prod() /
         std::tgamma(static_cast<double>(j) + 1);
}

// Smallest angle of the triangle on the columns, degrees.
double SmallestAngle(const Eigen::MatrixXd& corners) {
  double smallest = 180;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::VectorXd u = (corners.col((i + 1) % 3) - corners.col(i)).normalized();
    const Eigen::VectorXd v = (corners.col((i + 2) % 3) - corners.col(i)).normalized();
    // Right for small angles too, where the arc cosine is not.
    const double angle = 2 * std::atan2((u - v).norm(), (u + v).norm());
    smallest = std::min(smallest, angle * 180 / std::numbers::pi);
  }
  return smallest;
}

}  // namespace

Eigen::VectorXd PoleOf(Manifold& manifold) {
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(manifold.ambient_dimension(), 1);
  return manifold.ClosestPoint(ones).points.col(0).normalized();
}

Quality MeasureQuality(Manifold& manifold, const Eigen::MatrixXd& points,
                       const std::vector<std::uint32_t>& simplices, std::optional<double> clip) {
  const int k = manifold.dimension();
  const std::size_t corners = static_cast<std::size_t>(k) + 1;

  Quality quality;
  quality.min_fatness = std::numeric_limits<double>::infinity();
  quality.min_angle_degrees = k == 2 ? 180 : 0;
  Eigen::MatrixXd simplex(points.rows(), k + 1);
  for (std::size_t begin = 0; begin < simplices.size(); begin += corners) {
    for (int i = 0; i <= k; ++i) {
      simplex.col(i) = points.col(simplices[begin + static_cast<std::size_t>(i)]);
    }
    quality.min_fatness = std::min(quality.min_fatness, Fatness(simplex));
    if (k == 2) {
      quality.min_angle_degrees = std::min(quality.min_angle_degrees, SmallestAngle(simplex));
    }
  }

  bool faces_twice = false, simplices_distinct = false, vertices_used = false;
  for (int size = 1; size <= k + 1; ++size) {
    std::vector<Face> faces = Faces(simplices, corners, size);
    const std::size_t entries = faces.size();
    if (size == k && !clip) faces_twice = AllTwice(faces);
    if (size == k && clip) {
      const auto facet = static_cast<std::size_t>(k);
      faces_twice = EndInAClosedOne(faces, facet);
      quality.hausdorff = std::max(
          quality.hausdorff, FarthestFromEnd(PoleOf(manifold), *clip, points, Once(faces), facet));
    }
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    if (size == 1) vertices_used = static_cast<Eigen::Index>(faces.size()) == points.cols();
    if (size == k + 1) simplices_distinct = faces.size() == entries;
    quality.euler_characteristic +=
        (size % 2 == 1 ? 1 : -1) * static_cast<std::int64_t>(faces.size());
    quality.hausdorff =
        std::max(quality.hausdorff, FarthestBarycentre(manifold, points, faces, size));
  }
  quality.closed =
      faces_twice && simplices_distinct && vertices_used && !simplices.empty() &&
      quality.euler_characteristic == (clip ? 1 : manifold.facts().euler_characteristic);
  return quality;
}

}  // namespace stellate::bench
