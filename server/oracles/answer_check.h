#pragma once

#include "server/oracles/oracle_pool.h"

namespace stellate::server {

// Checks the answer to a chunk by core::CheckAnswers. A refusal names the lease and the row that is
// wrong. kOracleShape if the answer is not as long as the chunk.
Refused CheckAnswerShape(const core::Specification& spec, const Chunk& chunk,
                         const core::AnswerBlock& answer);
Refused CheckAnswer(const core::Specification& spec, const Chunk& chunk,
                    const core::AnswerBlock& answer);

}  // namespace stellate::server
