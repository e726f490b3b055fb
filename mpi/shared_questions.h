#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/batch.h"
#include "core/peers.h"
#include "core/specification.h"
#include "server/base/failure.h"
#include "server/oracles/oracle_pool.h"
#include "stellate/oracle.h"

namespace stellate::mpi {

// Has the oracles of all parts answer the questions of a mesh, each a share of every round.
//
//   SharedQuestions questions(spec, oracle, peers);
//   auto outcome = questions.Ask(batch);   // in all parts
class SharedQuestions {
 public:
  // workers: threads that call the oracle in parallel. most: points in one call of it; none: as
  // many as are some megabytes. All else is borrowed.
  SharedQuestions(const core::Specification& spec, Oracle& oracle, const core::Peers& peers,
                  int workers, std::optional<std::uint32_t> most);

  // Of one oracle, the first part's that has any.
  struct Outcome {
    core::Answers answers;
    std::optional<server::MeshFailure> failure;
  };
  // Waits for all parts, which ask the same: parts that do not are a failure.
  Outcome Ask(const std::shared_ptr<const core::QueryBatch>& batch) const;

 private:
  // Queries of a round that one call of the oracle answers.
  struct Piece;
  std::vector<Piece> OwnPieces(const core::QueryBatch& batch) const;
  std::optional<server::MeshFailure> Answer(const std::shared_ptr<server::Round>& round,
                                            Piece* piece) const;
  std::optional<server::MeshFailure> AnswerAll(const std::shared_ptr<server::Round>& round,
                                               std::vector<Piece>* pieces) const;

  const core::Specification& spec_;
  Oracle& oracle_;
  const core::Peers& peers_;
  const std::size_t workers_;
  const Eigen::Index most_;
};

}  // namespace stellate::mpi
