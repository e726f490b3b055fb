#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/boundary/boundary_policy.h"
#include "core/query_source.h"
#include "core/specification.h"

namespace stellate::core {

// What M turned out to be in place of a k-manifold.
struct OtherDimension {
  Eigen::VectorXd point;     // on M
  int dimension = 0;         // of M there, above k
  bool is_at_least = false;  // there may be more than were looked for
  int places = 0;            // vertices where it is so: all that were looked at
};

// Tests whether M has more dimensions than the specification says, which a run alone cannot see: M
// near a point, seen through random lines, looks like a curve that comes near to itself without
// end. The closest points of a few points around a vertex span M's tangent space there, and not
// only k directions of it. Queries closest points, once.
//
//   probe.Start(places, sizes);
//   // ... drive it as a QuerySource, then:
//   if (probe.found()) verdict += DescribeOtherDimension(*probe.found(), k);
class DimensionProbe final : public QuerySource {
 public:
  explicit DimensionProbe(const Specification& spec);

  // Starts again at these points of M, a column each, and forgets what it found. `sizes`: of the
  // mesh there, length. Without enough of them it is done.
  void Start(const Eigen::MatrixXd& places, const std::vector<double>& sizes);
  void Stop() { Start({}, {}); }

  // Returns nothing once it is done.
  std::vector<QueryBlock> Questions() override;
  // Uses the first block of the answers.
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool is_asking() const { return places_.cols() > 0; }
  const std::optional<OtherDimension>& found() const { return found_; }

 private:
  int RankAt(Eigen::Index place, const AnswerBlock& answer) const;

  int k_, d_;
  int lines_;                   // as many independent directions
  Eigen::MatrixXd directions_;  // both of each line, unit vectors
  BoundaryPolicy policy_;
  Eigen::MatrixXd places_;
  std::vector<double> sizes_;
  std::optional<OtherDimension> found_;
};

}  // namespace stellate::core
