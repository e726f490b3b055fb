#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/query_source.h"
#include "core/refinement/engine.h"
#include "core/run/tangent_finder.h"

namespace stellate::core {

// Queries a set of candidates, with all that inserting them needs. If the oracle intersects no
// flats it alternates between a candidate's flat and M instead (Criteria::flat_alternations); if it
// gives no tangents a TangentFinder finds them.
template <int K>
class RoundTrip final : public QuerySource {
 public:
  // The engine and the finder must outlive this; the engine must not change meanwhile.
  RoundTrip(const Engine<K>& engine, const OracleCapabilities& oracle, TangentFinder& finder,
            CandidateSet<K> candidates);

  std::vector<QueryBlock> Questions() override;
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool asks_for_tangents() const override { return finds_tangents_; }

  const CandidateSet<K>& candidates() const { return candidates_; }
  // Complete once there are no more questions.
  const AnsweredPoints& answers() const { return answers_; }
  // The points asked for by candidate, d x n, as far as closest points were.
  const Eigen::MatrixXd& asked() const { return asked_; }

 private:
  QueryBlock NewBlock(QueryKind kind, WallSet face) const;
  std::map<WallSet, int> OpenBlocks(const std::vector<WallSet>& faces);
  void FindKnown();
  bool IsKnown(Eigen::Index candidate) const {
    return !known_.empty() && known_[static_cast<std::size_t>(candidate)];
  }
  void TakeKnown(Eigen::Index candidate);
  WallSet SignsOfKnown(Eigen::Index candidate) const;
  void PlanPoints();
  void StandOff(Eigen::Index candidate, const double* tangent, const double* towards, double by);
  void AskForAll();
  void AskForDrawn();
  void Sort(const std::vector<AnswerBlock>& answers);
  void SortFaces(const std::vector<AnswerBlock>& answers);
  void AskAgain();
  void AskForTangents();
  void TakeTangents();

  const Engine<K>& engine_;
  const BoundaryPolicy policy_;
  const OracleCapabilities oracle_;
  TangentFinder& finder_;
  CandidateSet<K> candidates_;
  Eigen::MatrixXd asked_, offsets_;  // by candidate, d x n; offsets from the candidates, or empty
  std::vector<QueryBlock> open_;
  std::vector<WallSet> asked_faces_;                  // by block, of the open questions
  std::vector<std::pair<int, Eigen::Index>> places_;  // by candidate: block and column of open_
  // By drawn candidate: it is not queried, since it lies deep inside a domain of R^k, where each
  // point is its own closest point. Empty: all are queried.
  std::vector<std::uint8_t> known_;
  int alternations_left_ = 0;
  bool finds_tangents_ = false;
  AnsweredPoints answers_;
};

STELLATE_DECLARE_CLASS(RoundTrip)

}  // namespace stellate::core
