#pragma once

#include <vector>

#include "core/batch.h"

namespace stellate::core {

// Whatever asks for something: questions and answers in turn, until it knows what it wanted to.
class Asker {
 public:
  virtual ~Asker() = default;

  // What it asks next, all to be answered together; empty once it is done. To be called once before
  // each Absorb.
  virtual std::vector<QueryBlock> Questions() = 0;
  // The answers, a block for each block of questions (there may be more after these), which have
  // passed CheckAnswers.
  virtual void Absorb(const std::vector<AnswerBlock>& answers) = 0;
  // Whether the open questions are spent on finding tangents.
  virtual bool asks_for_tangents() const { return false; }
};

}  // namespace stellate::core
