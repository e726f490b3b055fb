#include "core/run/batch_parts.h"

#include <algorithm>
#include <utility>

namespace stellate::core {
namespace {

// Calls each(block, first column, columns) for the stretch [first, first + count) of the queries.
template <typename Each>
void ForEachPiece(const QueryBatch& batch, Eigen::Index first, Eigen::Index count,
                  const Each& each) {
  Eigen::Index begin = 0;
  for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
    const Eigen::Index size = batch.blocks[b].size();
    const Eigen::Index from = std::max(first, begin);
    const Eigen::Index to = std::min(first + count, begin + size);
    if (from < to) each(b, from - begin, to - from);
    begin += size;
  }
}

}  // namespace

BatchParts::BatchParts(const Specification& spec, QueryBatch whole, std::uint64_t most)
    : whole_(std::move(whole)),
      most_(static_cast<Eigen::Index>(std::min(most, static_cast<std::uint64_t>(whole_.size())))) {
  for (const QueryBlock& block : whole_.blocks)
    answers_.blocks.push_back(AnswerBlock::Shape(spec.dimension, spec.walls, block, block.size()));
  Cut();
}

void BatchParts::Cut() {
  part_ = std::make_shared<QueryBatch>();
  ForEachPiece(whole_, first_, most_, [&](std::size_t b, Eigen::Index from, Eigen::Index count) {
    part_->blocks.push_back(whole_.blocks[b].Rows(from, count));
  });
}

void BatchParts::PutInto(Answers* all, const Answers& answers) const {
  std::size_t next = 0;
  ForEachPiece(whole_, first_, most_, [&](std::size_t b, Eigen::Index from, Eigen::Index) {
    all->blocks[b].Put(from, answers.blocks[next++]);
  });
}

Answers BatchParts::With(const Answers& answers) const {
  Answers all = answers_;
  PutInto(&all, answers);
  return all;
}

void BatchParts::Take(const Answers& answers) {
  PutInto(&answers_, answers);
  first_ += part_->size();
  Cut();
}

}  // namespace stellate::core
