#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/batch.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// A finished mesh as the certifier sees it: the complex and the sample, nothing of how they came
// about. Borrowed; must outlive the Certifier.
struct MeshView {
  int k = 0, d = 0;
  std::uint64_t vertices = 0;
  const double* points = nullptr;    // vertices x d, C order
  const double* tangents = nullptr;  // vertices x k x d, C order, orthonormal rows
  const std::vector<std::uint32_t>* simplices = nullptr;  // k+1 ascending vertex ids each

  const double* Point(std::uint32_t v) const { return points + std::size_t{v} * d; }
  const double* Tangent(std::uint32_t v) const { return tangents + std::size_t{v} * d * k; }
};

// What only the stars know.
struct StarFacts {
  std::uint64_t inconsistent_simplices = 0;
  double max_circumradius = 0;  // max R_p(sigma)
  bool converged = false;       // no rule applies any more
  double max_size_ratio = 0;    // max R_p / size(p) where the size is graded, else 0
  bool covers_box = false;      // every component of M in the bounding box is met, if the declared
                                // reach is true
  double tangent_error_length = 0;  // sin(tangent_error) times the reach (TangentFinder), length
};

// Proves or refutes that a finished mesh is what was asked for. A state machine like Mesher: it
// asks for closest points in a few batches, then holds the certificate.
class Certifier {
 public:
  // `known`: points of M, d each, that were answered before and are no vertices.
  Certifier(const Specification& spec, const MeshView& mesh, const StarFacts& facts,
            std::vector<double> known = {});
  ~Certifier();

  // The next closest-point queries, or nullptr when the certificate is complete.
  const std::vector<QueryBlock>* NextBlocks();
  // Answers have passed CheckAnswers.
  void Absorb(const std::vector<AnswerBlock>& answers);
  const Certificate& certificate() const;
  // Once it is complete: points of M, d each, that the mesh has no vertex near. Where there are any
  // it is refused, but may become right when they are inserted.
  const std::vector<double>& Uncovered() const;
  // All that it knew or was answered, d each.
  std::vector<double> TakeSeen();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate::core
