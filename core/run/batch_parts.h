#pragma once

#include <cstdint>
#include <memory>

#include "core/batch.h"

namespace stellate::core {

// Cuts a round's batch into parts, if the client bounds the size of a batch, and joins their
// answers. The mesh does not depend on the cut. No QuerySource: the last part stays open until the
// joined answers are accepted.
//
//   BatchParts parts(spec, batch, most);
//   while (!parts.is_last()) parts.Take(answers to parts.part());
//   Use(parts.With(answers to parts.part()));
class BatchParts {
 public:
  // most: queries in a part, > 0
  BatchParts(const Specification& spec, QueryBatch whole, std::uint64_t most);

  // The part to ask now. Take makes another.
  const std::shared_ptr<QueryBatch>& part() { return part_; }
  bool is_last() const { return first_ + part_->size() == whole_.size(); }

  // Returns the answers to all parts so far, including `answers` to part(), which have been
  // checked. Copies all: use it for the last part only, which can then be answered again.
  Answers With(const Answers& answers) const;
  // Keeps the answers to part() and goes to the next one. Copies these answers alone.
  void Take(const Answers& answers);

 private:
  void Cut();
  void PutInto(Answers* all, const Answers& answers) const;

  QueryBatch whole_;
  std::shared_ptr<QueryBatch> part_;
  Eigen::Index most_;
  Eigen::Index first_ = 0;  // query of the whole that part_ begins with
  Answers answers_;         // to the queries before
};

}  // namespace stellate::core
