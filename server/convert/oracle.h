#pragma once

#include "core/batch.h"
#include "server/oracles/oracle_pool.h"
#include "stellate/v1/oracle.pb.h"

namespace stellate::server {

void ToProto(const core::Specification& spec, v1::Welcome* welcome);
void ToProto(const Chunk& chunk, const core::Specification& spec, v1::QueryChunk* out);

// kOracleShape if an array is not of the shape that `chunk` asks for; nothing is allocated on the
// word of a declared shape. Tangents that were not asked for are ignored. Values are not looked at.
// The refusal names the lease, and the row at fault where there is one.
Allowed<core::AnswerBlock> FromProto(const v1::AnswerChunk& answers, const Chunk& chunk,
                                     const core::Specification& spec);

}  // namespace stellate::server
