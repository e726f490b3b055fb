#pragma once

#include "server/oracles/oracle_pool.h"

namespace stellate::server {

// core::CheckAnswers of the answer to a chunk; what it refuses says the lease and the row at fault.
// kOracleShape if the answer is not as long as the chunk.
Refused CheckAnswer(const core::Specification& spec, const Chunk& chunk,
                    const core::AnswerBlock& answer);

}  // namespace stellate::server
