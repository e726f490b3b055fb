#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// Compares the client's tangent spaces with its closest points: a small step off M across the
// tangent space comes back to its start, one along it stays where it is. A wire that is declared a
// curve, or a plate that is declared a surface, has directions for which neither holds. Neither
// holds where M bends within the step: a step that fails is therefore repeated, much shorter.
class TangentCheck {
 public:
  // As a share of the step. Tangent spaces wrong by 0.03 are harmless; by 0.2 refinement diverges;
  // what is not a tangent space at all is wrong by about 1.
  static constexpr double kTolerance = 0.15;

  // Chooses random vertices; steps are a small share of the mesh size there.
  explicit TangentCheck(const Examination& examination);

  // Returns points whose closest points to query, d x n; empty: the check is done.
  Eigen::MatrixXd Questions() const;
  // Returns what is wrong, in plain words; empty if nothing is, or if a shorter step must be
  // queried first.
  std::string Judge(const AnswerBlock& answer);

  // A place where M bends so much within a step that only a shorter one passed: the vertex, whose
  // tangent space is right to kTolerance, and the point y of M that the longer step found.
  struct Bend {
    std::uint32_t vertex = 0;
    Eigen::VectorXd y;
  };
  const std::vector<Bend>& bends() const { return bends_; }

 private:
  struct Step {
    std::uint32_t vertex;
    bool across;
    double length;
    Eigen::VectorXd to;      // from the vertex, of that length
    Eigen::VectorXd answer;  // what a longer one was answered with; empty: this is the first
  };
  std::string Accuse(const Step& step, double off) const;

  const Examination& x_;
  std::vector<Step> steps_;  // that are open
  std::vector<Bend> bends_;
};

}  // namespace stellate::core
