#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/batch.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Holds tangent spaces that the client gives against its closest points: a small step off M across
// the tangent space comes back to where it began, one along it stays where it is. A wire declared a
// curve, or a wall declared a surface, has directions for which neither is so.
class TangentCheck {
 public:
  // At random vertices; steps are a small share of `size`, a length.
  TangentCheck(const MeshView& mesh, double size, std::uint64_t random_seed);

  // Closest points to be asked for, d x n.
  Eigen::MatrixXd Questions() const;
  // What is wrong, in plain words; empty if nothing is. `position_error`: of the oracle, as seen.
  std::string Judge(const AnswerBlock& answer, double position_error) const;

 private:
  struct Step {
    std::uint32_t vertex;
    bool across;
    Eigen::VectorXd to;  // from the vertex
  };

  const MeshView& mesh_;
  double length_;
  std::vector<Step> steps_;
};

}  // namespace stellate::core
