#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stellate/pointwise.h"

// Manifolds through points and triangles. Constructors throw std::invalid_argument.
namespace stellate::oracles {

// A smooth k-manifold near given points of R^d, which may be noisy, by moving least squares.
//
// It is where the least-squares quadric through a place's neighbours, weighted by how near they
// are, goes through the place itself. Where the points' noise is s, it lies within about s of the
// manifold that they were taken from, plus bandwidth^3 times the change of its curvature; an
// epsilon below the bandwidth meshes the smoothing.
//
//   stellate::oracles::PointCloud cloud(stellate::oracles::ReadPoints("scan.ply"), 2);
//   std::cerr << cloud.about() << '\n';  // with the bandwidth
class PointCloud : public PointwiseOracle {
 public:
  // The points (d x n) have to lie on all of the manifold, at distances well below its reach.
  // `bandwidth` is how far points are neighbours of a place. By default each point has one of its
  // own: twice the distance within which it and those about it have 2 k + 3 others, or what it
  // takes for noise to add no more than a tenth to the curvature. Smoother when larger; sheets have
  // to be farther apart.
  PointCloud(Eigen::MatrixXd points, int dimension, std::optional<double> bandwidth = {});
  ~PointCloud() override;

  double bandwidth() const { return bandwidth_; }  // the points' median
  const Eigen::VectorXd& bandwidths() const;       // n, the points' own
  // How far the points are from the manifold, 95 in 100 of them: the noise, and what the quadric
  // does not follow.
  double residual() const { return residual_; }

  // Servers find intersections from closest points.
  bool has_intersect_flat() const override { return false; }
  std::optional<BoundingBox> bounding_box() const override;
  // How many points, how far neighbours reach, how far the points are off.
  std::string about() const override;

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override;

 private:
  class Neighbourhoods;

  std::unique_ptr<const Neighbourhoods> around_;
  double bandwidth_ = 0, residual_ = 0;
};

// Triangles in R^3 that share their corners.
struct Triangles {
  Eigen::MatrixXd points;   // 3 x n
  Eigen::MatrixXi corners;  // 3 x m, numbers of points
};

// Reads .off, .obj, .stl or .ply; other polygons than triangles are split. Throws
// std::invalid_argument, saying which file.
Triangles ReadTriangles(const std::string& path);

// Reads points, d x n: of .ply the x, y and z of its vertices, whatever faces it has; of .npy an
// array (n, d); of .csv, .xyz and .txt, and of standard input, "-", a point a line, its numbers
// between blanks or commas, after a line of titles if there is one, without what follows '#'.
// `coordinates`: keeps the first so many of each; by default all. `columns`: keeps these, in this
// order, by their titles or by their numbers from 1; what is in the others need not be numbers. A
// file whose titles are x, y, z and others is refused without either: the others may be times or
// colours. Throws std::invalid_argument, saying which file and which line.
Eigen::MatrixXd ReadPoints(const std::string& path, std::optional<int> coordinates = {},
                           const std::vector<std::string>& columns = {});

struct TriangleMeshOptions {
  // Triangles with longer edges are filled with points of this spacing; by default the median of
  // the edges' lengths.
  std::optional<double> spacing;
  std::optional<double> bandwidth;  // how far creases are rounded; by default 3 spacings
};

// The smooth surface in R^3 near a closed mesh of triangles, to be meshed again.
//
// It is a PointCloud through the vertices, and through the middle of triangles that are large:
// nearer to the surface that was triangulated than the triangles are, where it is smooth. Edges and
// corners that are meant are rounded.
class TriangleMesh final : public PointCloud {
 public:
  explicit TriangleMesh(const Triangles& triangles, const TriangleMeshOptions& options = {});
  explicit TriangleMesh(const std::string& path, const TriangleMeshOptions& options = {});

 private:
  struct Samples;
  explicit TriangleMesh(Samples samples);
};

}  // namespace stellate::oracles
