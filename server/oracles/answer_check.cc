#include "server/oracles/answer_check.h"

#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::StatusCode;
using Eigen::Index;

// The first row that breaks a rule by itself; none where the answer as a whole has the wrong shape.
std::optional<std::int64_t> RowAtFault(const core::Specification& spec, const Chunk& chunk,
                                       const core::AnswerBlock& answer) {
  for (Index row = 0; row < answer.points.cols(); ++row) {
    const auto alone =
        core::CheckAnswers(spec, chunk.block(), chunk.first + row, answer.Rows(row, 1));
    if (!alone.ok()) return row;
  }
  return std::nullopt;
}

}  // namespace

Refused CheckAnswerShape(const core::Specification& spec, const Chunk& chunk,
                         const core::AnswerBlock& answer) {
  const AnswerPlace place{chunk.lease, std::nullopt};
  if (answer.points.cols() != chunk.count) {
    return {place,
            {StatusCode::kOracleShape,
             core::Message("answers to lease ", chunk.lease, " hold ", answer.points.cols(),
                           " points but the chunk has ", chunk.count,
                           " queries: send one point for each query")}};
  }
  core::Status status = core::CheckAnswerShape(spec, chunk.block(), chunk.first, answer);
  if (status.ok()) return status;
  return {place, std::move(status)};
}

Refused CheckAnswer(const core::Specification& spec, const Chunk& chunk,
                    const core::AnswerBlock& answer) {
  if (Refused shape = CheckAnswerShape(spec, chunk, answer); !shape.ok()) return shape;
  core::Status status = core::CheckAnswers(spec, chunk.block(), chunk.first, answer);
  if (status.ok()) return status;
  return {AnswerPlace{chunk.lease, RowAtFault(spec, chunk, answer)}, std::move(status)};
}

}  // namespace stellate::server
