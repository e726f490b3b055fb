#pragma once

#include <vector>

#include "core/batch.h"

namespace stellate::core {

// A source of queries: a run, a round, tangent spaces, the certificate, edges at creases. Drive it
// so:
//
//   while (!(questions = source.Questions()).empty()) source.Absorb(answers of the questions);
class QuerySource {
 public:
  virtual ~QuerySource() = default;

  // Returns the next queries, to be answered together; empty when it is done. Call it once before
  // each Absorb.
  virtual std::vector<QueryBlock> Questions() = 0;
  // Takes the answers, one block for each block of queries; further blocks are ignored. REQUIRES:
  // they passed CheckAnswers.
  virtual void Absorb(const std::vector<AnswerBlock>& answers) = 0;
  // Whether the open queries are for finding tangents.
  virtual bool asks_for_tangents() const { return false; }
};

}  // namespace stellate::core
