#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// Holds tangent spaces that the client gives against its closest points: a small step off M across
// the tangent space comes back to where it began, one along it stays where it is. A wire declared a
// curve, or a wall declared a surface, has directions for which neither is so. Where M bends within
// the step neither is so either: a step that goes wrong is taken once more, much shorter.
class TangentCheck {
 public:
  // Of the step: tangent spaces wrong by 0.03 are harmless, by 0.2 refinement diverges; what is not
  // a tangent space at all is wrong by about 1.
  static constexpr double kTolerance = 0.15;

  // At random vertices; steps are a small share of the mesh size there.
  explicit TangentCheck(const Examination& examination);

  // Closest points to be asked for, d x n; none: all is told.
  Eigen::MatrixXd Questions() const;
  // What is wrong, in plain words; empty if nothing is, or if it has to be asked again.
  std::string Judge(const AnswerBlock& answer);

  // Where M bends so much within a step that only a shorter one was right: from this vertex the
  // point y of M was found, whose tangent space is right to kTolerance.
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
