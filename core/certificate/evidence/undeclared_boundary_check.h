#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/batch.h"

namespace stellate::core {

// Whether `along`, the length of the tangential part of q - y, is a noticeable share of `distance`,
// |q - y|.
inline bool HasTangentialOffset(double along, double distance) { return along > 0.2 * distance; }

// Finds an undeclared boundary. On a manifold without boundary each query q lies straight above its
// closest point y: q - y is normal to T_yM. If it has a tangential offset instead, M ends at y, or
// the tangent space there is poorly known. Two steps from y decide, one in the direction of the
// offset and one in the opposite direction: inside M both go equally far, for any tangent space; at
// the boundary the first comes back. The steps are half as long as the offset, so that the first
// stays over the hole that q was over.
//
//   UndeclaredBoundaryCheck check(mesh_size);
//   check.Add(y, along, distance);                           // for each answer y
//   const Eigen::MatrixXd asked = check.Questions(error);    // then their closest points:
//   std::string problem = check.Judge(ClosestPoints(asked), error);
class UndeclaredBoundaryCheck {
 public:
  // `size`: the mesh's, length.
  explicit UndeclaredBoundaryCheck(double size) : size_(size) {}

  // Notes the answer y if it has a tangential offset. `along`: the part of q - y along M's tangent
  // space at y; `distance`: |q - y|.
  void Add(const Eigen::VectorXd& y, const Eigen::VectorXd& along, double distance);

  // Returns points whose closest points to query, d x n: two for each of the 32 largest offsets
  // noted since the last call, without those that the answers' `position_error` explains.
  Eigen::MatrixXd Questions(double position_error);
  // Returns the first place where M ends, in plain words, or "".
  std::string Judge(const AnswerBlock& answer, double position_error) const;

 private:
  struct Place {
    Eigen::VectorXd y, direction;  // unit
    double length = 0, share = 0;
  };
  double size_;
  std::vector<Place> places_, asked_;
};

}  // namespace stellate::core
