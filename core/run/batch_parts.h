#pragma once

#include <cstdint>

#include "core/batch.h"

namespace stellate::core {

// A round's batch, asked in parts because the client takes no more at once. The answers come
// together again as if it had been asked whole, so that the mesh does not depend on the cut.
class BatchParts {
 public:
  // most: queries a part, > 0
  BatchParts(const Specification& spec, QueryBatch whole, std::uint64_t most);

  QueryBatch& part() { return part_; }
  bool is_last() const { return first_ + part_.size() == whole_.size(); }

  // The answers to all parts so far and to part(), which they answer and have been checked against.
  Answers With(const Answers& answers) const;
  // Keeps them and goes on to the next part.
  void Take(const Answers& answers);

 private:
  void Cut();

  QueryBatch whole_, part_;
  Eigen::Index most_;
  Eigen::Index first_ = 0;  // query of the whole that part_ begins with
  Answers answers_;         // to the queries before
};

}  // namespace stellate::core
