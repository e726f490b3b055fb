#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "oracles/ready/cloud_bandwidths.h"
#include "oracles/ready/point_tree.h"

namespace stellate::oracles {

// How many coefficients a quadric over a k-plane has in each direction.
inline Eigen::Index QuadricTerms(Eigen::Index k) { return 1 + k + k * (k + 1) / 2; }

// Least squares about a place, over the plane through its m neighbours; t terms.
struct CloudFit {
  Eigen::VectorXd weights;        // m
  Eigen::MatrixXd terms;          // t x m, of a quadric, in lengths of `scale`
  Eigen::MatrixXd heights;        // (d - k) x m, over the plane
  Eigen::MatrixXd system;         // t x t
  Eigen::MatrixXd solution;       // t x (d - k)
  Eigen::MatrixXd along, across;  // d x k, the plane; d x (d - k)
  double scale = 0;               // the length of the neighbours' bandwidths
};

// A surface of second order over a plane, at one place.
struct CloudQuadric {
  Eigen::VectorXd place;     // d, on it
  Eigen::MatrixXd tangents;  // d x k, there
};

// The points of a cloud and how far each of them counts as a neighbour.
class CloudQuadrics {
 public:
  CloudQuadrics(const Eigen::MatrixXd& points, Eigen::Index k);  // d x n, kept by the caller

  // Gives the points bandwidths (n, positive), and each half octave of these a tree of its own, to
  // search as far.
  void Reach(Eigen::VectorXd bandwidths);
  const Eigen::VectorXd& bandwidths() const { return bandwidths_; }

  // False where the neighbours are too few.
  bool Fit(const Eigen::VectorXd& place, CloudFit* fit) const;
  // What the quadrics at each so many points are like.
  CloudFits FitsAt(Eigen::Index stride) const;

  CloudQuadric QuadricOf(const CloudFit& fit, const Eigen::VectorXd& place) const;
  // The tangent step towards the point nearest to x: Newton's, downhill in any case.
  Eigen::VectorXd Towards(const CloudFit& fit, const CloudQuadric& quadric,
                          const Eigen::VectorXd& x) const;

 private:
  struct HalfOctave {
    std::vector<Eigen::Index> members;
    std::unique_ptr<const PointTree> tree;
    double reach;
  };
  struct Neighbour {
    Eigen::Index point;
    double weight;
  };

  std::vector<Neighbour> NeighboursOf(const Eigen::VectorXd& place) const;

  const Eigen::MatrixXd& points_;
  const Eigen::Index k_;
  Eigen::VectorXd bandwidths_;
  std::vector<HalfOctave> octaves_;
};

}  // namespace stellate::oracles
