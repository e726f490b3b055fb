#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stellate {

// Numbers of walls, ascending. A face of a manifold with boundary is known by those it lies on.
using Walls = std::vector<int>;

// Axis-aligned box of R^d, lower < upper in each coordinate.
struct BoundingBox {
  Eigen::VectorXd lower, upper;  // d each
};

// The answers to a batch of n queries, column j to query j.
struct Answer {
  Eigen::MatrixXd points;                // d x n; ignored where not found
  std::vector<std::uint8_t> found = {};  // n, 1 or 0; empty: all found
  Eigen::MatrixXd tangents = {};         // (d k) x n laid out as a basis (see Oracle), or empty
  Eigen::VectorXd sizes = {};            // n, of the points, or empty
  // Of walls, as Oracle::Clearances and Conormals have them, or empty.
  Eigen::MatrixXd clearances = {}, conormals = {};

  bool IsFound(Eigen::Index j) const { return found.empty() || found[static_cast<size_t>(j)] != 0; }
};

// Thrown by an oracle if a function that it is made of is wrong: a std::runtime_error with a stable
// name, "ORACLE_PRECISION" or "ORACLE_SHAPE".
class OracleError : public std::runtime_error {
 public:
  OracleError(std::string reason, const std::string& what)
      : std::runtime_error(what), reason_(std::move(reason)) {}

  const std::string& reason() const { return reason_; }

 private:
  std::string reason_;
};

// A compact smooth k-submanifold M of R^d, known by its answers to queries. Derive from it to mesh
// a manifold of your own. Required: dimension, ambient_dimension, ClosestPoint, and one of
// bounding_box and seeds. PointwiseOracle and ImplicitOracle do more of the work.
//
//   struct Circle : stellate::Oracle {
//     int dimension() const override { return 1; }
//     int ambient_dimension() const override { return 2; }
//     stellate::Answer ClosestPoint(const Eigen::MatrixXd& x) override {
//       return {x.colwise().normalized()};
//     }
//     Eigen::MatrixXd seeds() const override { return Eigen::Vector2d(1, 0); }
//   };
//
// Queries come in batches, one a column. A basis of k vectors of R^d is a column of d k numbers:
// entry i*k + a is coordinate i of vector a.
//
// With several workers, several threads call the methods in parallel. An exception ends the
// run and reaches the caller of MeshManifold unchanged.
class Oracle {
 public:
  static constexpr std::uint8_t kNoSuchSigns = 255;  // among labels

  virtual ~Oracle() = default;

  virtual int dimension() const = 0;          // k
  virtual int ambient_dimension() const = 0;  // d > k, or d = k with walls

  // A point of M nearest to each column of x (d x n).
  virtual Answer ClosestPoint(const Eigen::MatrixXd& x) = 0;

  // The point of M nearest to each centre c in the (d-k)-flat c + T^perp, no farther than its
  // radius from c. Called only when has_intersect_flat.
  //   centers d x n    bases (d k) x n, the orthonormal T of each flat    radii n
  virtual bool has_intersect_flat() const { return false; }
  virtual Answer IntersectFlat(const Eigen::MatrixXd& /*centers*/, const Eigen::MatrixXd& /*bases*/,
                               const Eigen::VectorXd& /*radii*/) {
    throw std::logic_error("this oracle does not intersect flats");
  }

  // Orthonormal tangent bases, (d k) x n, at points of M (d x n). Called only when
  // has_tangent_basis and the answer has none; without, the server computes them.
  virtual bool has_tangent_basis() const { return false; }
  virtual Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& /*points*/) {
    throw std::logic_error("this oracle has no tangent bases");
  }

  // Sizes at points of M (d x n), one positive length each: the local feature size there, or any
  // size field of yours. MeshOptions::size_rate and max_deviation use it; it is called only with
  // them, and only where the answer has none. Without, the server estimates sizes. A point's size
  // must depend on the point alone.
  virtual bool has_local_size() const { return false; }
  virtual Eigen::VectorXd LocalSize(const Eigen::MatrixXd& /*points*/) {
    throw std::logic_error("this oracle has no local sizes");
  }

  // The number of equations F_i = 0 of M, if it has any, and their gradients at points (d x n): (m
  // d) x n for m equations, entry i*d + j is dF_i / dx_j. Only Check calls it, to find points where
  // M crosses itself or has a tip.
  virtual int equations() const { return 0; }
  virtual Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& /*points*/) {
    throw std::logic_error("this oracle has no equations");
  }

  // The number of walls of a manifold with boundary, M = { x in M^ : g_i(x) >= 0, i < walls() }.
  // The methods above are then those of M^, whose dimension may be d. Tangent bases and the three
  // methods below are required then; oracles::Clipped implements them.
  virtual int walls() const { return 0; }
  // For each column of x (d x n) a nearest one of the points of M^ where the walls of the face are
  // zero.
  virtual Answer FacePoint(const Eigen::MatrixXd& /*x*/, const Walls& /*face*/) {
    throw std::logic_error("this oracle has no walls");
  }
  // The walls' values g_i at points (d x n), walls() x n. Only the sign counts.
  virtual Eigen::MatrixXd Clearances(const Eigen::MatrixXd& /*points*/) {
    throw std::logic_error("this oracle has no walls");
  }
  // At points of a face (d x n), for each of its walls the outward unit normal within the tangent
  // space, along which g_i decreases: (f d) x n for f walls, entry i*d + j is coordinate j of wall
  // i's.
  virtual Eigen::MatrixXd Conormals(const Eigen::MatrixXd& /*points*/, const Walls& /*face*/) {
    throw std::logic_error("this oracle has no walls");
  }

  // An arrangement: M is not where all walls are positive, but consists of a region for each label
  // from 1 to 127. One for each of the 2^walls() vectors of the walls' signs, in whose number bit i
  // is set where g_i >= 0; 0 is outside of M, and kNoSuchSigns stands for a vector that no point
  // has. All regions are meshed together, and Mesh::labels says which simplex is in which. At most
  // 16 walls may have labels. Empty: no arrangement.
  virtual std::vector<std::uint8_t> labels() const { return {}; }
  // Sets of walls with labels, for walls that depend on each other: each of a set, of three or
  // more, is zero wherever all others of it are, as f - g, g - h and f - h are. A face is then
  // asked for with all walls that are zero on it, although some follow from others.
  virtual std::vector<Walls> closures() const { return {}; }
  // The names of the regions with the labels 1, 2, ..., for people and for groups in files; an
  // empty one is none. At most 128 bytes each.
  virtual std::vector<std::string> region_names() const { return {}; }

  // Where to look for M: a box, or points near M, at least one on each component.
  virtual std::optional<BoundingBox> bounding_box() const { return std::nullopt; }
  virtual Eigen::MatrixXd seeds() const { return {}; }  // d x m

  // Where axes have different units: the oracle of {x / scale : x in M}, for scale (d) above zero.
  // It may share what this one is made of, and does not refer to this one. Null: its nearest points
  // are not known. oracles::InUnits, which asks, goes on asking this one for sizes and names.
  virtual std::shared_ptr<Oracle> DividedBy(const Eigen::VectorXd& /*scale*/) const { return {}; }
  // Points of the mesh are delivered multiplied by it, d lengths, as InUnits wants. Empty: as they
  // are.
  virtual Eigen::VectorXd coordinate_scale() const { return {}; }

  // One sentence that it says of itself, for people, such as what it was fitted with: the verdict
  // ends with its first 300 characters, as the oracle's own words. UTF-8, without controls.
  virtual std::string about() const { return {}; }
};

}  // namespace stellate
