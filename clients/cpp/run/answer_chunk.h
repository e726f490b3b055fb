#pragma once

#include "stellate/oracle.h"
#include "stellate/v1/oracle.pb.h"

namespace stellate::client {

// What the oracle says to a chunk. Shapes are as the oracle has them: the server checks them, and
// names what is wrong. False when the chunk makes no sense; lets the oracle's exceptions through.
bool AnswerChunk(Oracle& oracle, const v1::QueryChunk& chunk, v1::AnswerChunk* answers);

}  // namespace stellate::client
