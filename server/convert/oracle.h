#pragma once

#include "core/batch.h"
#include "server/oracles/oracle_pool.h"
#include "stellate/v1/oracle.pb.h"

namespace stellate::server {

void ToProto(const core::Specification& spec, v1::Welcome* welcome);
void ToProto(const Chunk& chunk, const core::Specification& spec, v1::QueryChunk* out);

// kOracleShape if an array does not have the shape that `chunk` asks for; a declared shape alone
// allocates nothing. Tangents that were not asked for are ignored. Values are not checked. The
// refusal names the lease, and the row if there is one.
Allowed<core::AnswerBlock> FromProto(const v1::AnswerChunk& answers, const Chunk& chunk,
                                     const core::Specification& spec);

}  // namespace stellate::server
