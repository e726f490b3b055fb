#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <vector>

#include "oracles/combined/common.h"
#include "stellate/oracles/points.h"

namespace stellate::oracles {
namespace {

constexpr double kMostPoints = 5e6;
constexpr double kLongEdge = 1.5;  // in spacings: a triangle with a longer one is filled
constexpr double kSamePoint = 1e-6;

bool Before(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
}

void Check(const Triangles& triangles) {
  if (triangles.corners.size() > 0 && triangles.corners.rows() != 3) {
    Refuse("triangles have three corners, and these " + std::to_string(triangles.corners.rows()));
  }
  CheckPoints(triangles.points, "points");
  if (triangles.points.rows() != 3) {
    Refuse("triangles have to be in R^3, and are in R^" + std::to_string(triangles.points.rows()));
  }
  if (triangles.corners.size() == 0 || triangles.corners.minCoeff() < 0 ||
      triangles.corners.maxCoeff() >= triangles.points.cols()) {
    Refuse("triangles have to name points from 0 to " +
           std::to_string(triangles.points.cols() - 1));
  }
}

// Equal points made one, as .stl files have a point for each corner of each triangle; in ascending
// order, those of no triangle left out.
Triangles Merged(const Triangles& given) {
  std::vector<int> order;
  std::vector<bool> used(static_cast<size_t>(given.points.cols()), false);
  for (const int corner : given.corners.reshaped()) used[static_cast<size_t>(corner)] = true;
  for (int j = 0; j < given.points.cols(); ++j) {
    if (used[static_cast<size_t>(j)]) order.push_back(j);
  }
  const auto point = [&given](int j) { return given.points.col(j); };
  std::stable_sort(order.begin(), order.end(),
                   [&](int i, int j) { return Before(point(i), point(j)); });
  std::vector<int> names(used.size(), 0);
  Triangles merged{Eigen::MatrixXd(3, std::ssize(order)), given.corners};
  int count = 0;
  for (const int j : order) {
    if (count == 0 || point(j) != merged.points.col(count - 1))
      merged.points.col(count++) = point(j);
    names[static_cast<size_t>(j)] = count - 1;
  }
  merged.points.conservativeResize(Eigen::NoChange, count);
  for (int& corner : merged.corners.reshaped()) corner = names[static_cast<size_t>(corner)];
  return merged;
}

void InsistOnClosed(const Eigen::MatrixXd& points, const Eigen::MatrixXi& triangles) {
  std::map<std::array<int, 2>, int> counts;
  for (Eigen::Index j = 0; j < triangles.cols(); ++j) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(triangles(i, j), triangles((i + 1) % 3, j));
      ++counts[{low, high}];
    }
  }
  const auto with = [&counts](auto wanted) {
    return std::to_string(std::count_if(counts.begin(), counts.end(),
                                        [&](const auto& edge) { return wanted(edge.second); }));
  };
  const bool closed =
      std::all_of(counts.begin(), counts.end(), [](const auto& edge) { return edge.second == 2; });
  if (closed) return;
  const auto odd =
      std::find_if(counts.begin(), counts.end(), [](const auto& edge) { return edge.second != 2; });
  const Eigen::Vector3d middle = (points.col(odd->first[0]) + points.col(odd->first[1])) / 2;
  Refuse("the surface is not closed: " + with([](int n) { return n == 1; }) +
         " edges have one triangle, " + with([](int n) { return n > 2; }) +
         " more than two, as near (" + Short(middle[0]) + ", " + Short(middle[1]) + ", " +
         Short(middle[2]) +
         "). Fill its holes and remove what hangs from it, in a program that repairs meshes; of a "
         "surface that is meant to have an end, a PointCloud of its vertices is cut by walls");
}

// The edges of each triangle, 3 x m.
Eigen::MatrixXd EdgesOf(const Triangles& triangles) {
  Eigen::MatrixXd edges(3, triangles.corners.cols());
  for (Eigen::Index j = 0; j < edges.cols(); ++j) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      const int a = triangles.corners(i, j), b = triangles.corners((i + 1) % 3, j);
      edges(i, j) = (triangles.points.col(a) - triangles.points.col(b)).norm();
    }
  }
  return edges;
}

// Points in triangles whose edges are longer, on a grid of about the spacing; those with few of
// them first.
void Fill(const Triangles& triangles, const Eigen::VectorXd& longest, double spacing,
          std::vector<Eigen::VectorXd>* points) {
  const Eigen::VectorXd pieces = (longest / (kLongEdge * spacing)).array().ceil();
  if (0.5 * pieces.squaredNorm() > kMostPoints) {
    Refuse("a spacing of " + Short(spacing) + " makes more than 5,000,000 points: a larger one?");
  }
  std::map<int, std::vector<Eigen::Index>> by_pieces;
  for (Eigen::Index j = 0; j < pieces.size(); ++j) {
    if (pieces[j] > 1) by_pieces[static_cast<int>(pieces[j])].push_back(j);
  }
  for (const auto& [count, mine] : by_pieces) {
    for (const Eigen::Index j : mine) {
      Eigen::Matrix3d corners;
      for (Eigen::Index i = 0; i < 3; ++i) {
        corners.col(i) = triangles.points.col(triangles.corners(i, j));
      }
      for (int a = 0; a <= count; ++a) {
        for (int b = 0; a + b <= count; ++b) {
          const Eigen::Vector3d shares = Eigen::Vector3d(count - a - b, a, b) / count;
          points->push_back(shares[0] * corners.col(0) + shares[1] * corners.col(1) +
                            shares[2] * corners.col(2));
        }
      }
    }
  }
}

// An edge's points are those of both of its triangles, up to rounding: the first of each is kept.
Eigen::MatrixXd WithoutRepeats(const std::vector<Eigen::VectorXd>& points, double spacing) {
  std::vector<Eigen::VectorXd> rounded;
  rounded.reserve(points.size());
  for (const Eigen::VectorXd& point : points) {
    rounded.push_back((point / (kSamePoint * spacing)).array().rint());
  }
  std::vector<size_t> order(points.size()), kept;
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t i, size_t j) { return Before(rounded[i], rounded[j]); });
  for (size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || rounded[order[i]] != rounded[order[i - 1]]) kept.push_back(order[i]);
  }
  std::sort(kept.begin(), kept.end());
  Eigen::MatrixXd result(3, std::ssize(kept));
  for (size_t i = 0; i < kept.size(); ++i) {
    result.col(static_cast<Eigen::Index>(i)) = points[kept[i]];
  }
  return result;
}

}  // namespace

struct TriangleMesh::Samples {
  Samples(const Triangles& given, const TriangleMeshOptions& options) {
    Check(given);
    const Triangles triangles = Merged(given);
    InsistOnClosed(triangles.points, triangles.corners);
    const Eigen::MatrixXd edges = EdgesOf(triangles);
    const double spacing = options.spacing
                               ? *options.spacing
                               : Quantile({edges.reshaped().begin(), edges.reshaped().end()}, 0.5);
    if (!std::isfinite(spacing) || spacing <= 0) {
      Refuse("spacing has to be positive, and is " + Short(spacing));
    }
    std::vector<Eigen::VectorXd> all;
    for (const auto& point : triangles.points.colwise()) all.emplace_back(point);
    Fill(triangles, edges.colwise().maxCoeff(), spacing, &all);
    points = WithoutRepeats(all, spacing);
    bandwidth = options.bandwidth.value_or(3 * spacing);
  }
  Eigen::MatrixXd points;
  double bandwidth;
};

TriangleMesh::TriangleMesh(Samples samples)
    : PointCloud(std::move(samples.points), 2, samples.bandwidth) {}

TriangleMesh::TriangleMesh(const Triangles& triangles, const TriangleMeshOptions& options)
    : TriangleMesh(Samples(triangles, options)) {}

TriangleMesh::TriangleMesh(const std::string& path, const TriangleMeshOptions& options)
    : TriangleMesh(ReadTriangles(path), options) {}

}  // namespace stellate::oracles
