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

BatchParts::BatchParts(QueryBatch whole, std::uint64_t most)
    : whole_(std::move(whole)),
      most_(static_cast<Eigen::Index>(std::min(most, static_cast<std::uint64_t>(whole_.size())))) {
  for (const QueryBlock& block : whole_.blocks) {
    AnswerBlock answer;
    answer.points.setZero(block.points.rows(), block.size());
    answer.found.assign(static_cast<std::size_t>(block.size()), 1);
    answers_.blocks.push_back(std::move(answer));
  }
  Cut();
}

void BatchParts::Cut() {
  part_.blocks.clear();
  ForEachPiece(whole_, first_, most_, [&](std::size_t b, Eigen::Index from, Eigen::Index count) {
    const QueryBlock& block = whole_.blocks[b];
    QueryBlock piece;
    piece.kind = block.kind;
    piece.want_tangents = block.want_tangents;
    piece.want_sizes = block.want_sizes;
    piece.face = block.face;
    piece.want_clearances = block.want_clearances;
    piece.points = block.points.middleCols(from, count);
    if (block.bases.size() > 0) piece.bases = block.bases.middleCols(from, count);
    if (block.radii.size() > 0) piece.radii = block.radii.segment(from, count);
    part_.blocks.push_back(std::move(piece));
  });
}

Answers BatchParts::With(const Answers& answers) const {
  Answers all = answers_;
  std::size_t next = 0;
  ForEachPiece(whole_, first_, most_, [&](std::size_t b, Eigen::Index from, Eigen::Index count) {
    const AnswerBlock& piece = answers.blocks[next++];
    AnswerBlock& block = all.blocks[b];
    block.points.middleCols(from, count) = piece.points;
    if (!piece.found.empty())
      std::copy(piece.found.begin(), piece.found.end(), block.found.begin() + from);
    const QueryBlock& asked = whole_.blocks[b];
    // Where nothing was found they may be missing.
    if (asked.want_tangents && piece.tangents.size() > 0) {
      if (block.tangents.size() == 0) block.tangents.setZero(piece.tangents.rows(), asked.size());
      block.tangents.middleCols(from, count) = piece.tangents;
    }
    if (asked.want_sizes && piece.sizes.size() > 0) {
      if (block.sizes.size() == 0) block.sizes.setZero(asked.size());
      block.sizes.segment(from, count) = piece.sizes;
    }
    const auto join = [&](Eigen::MatrixXd& joined, const Eigen::MatrixXd& more) {
      if (more.size() == 0) return;
      if (joined.size() == 0) joined.setZero(more.rows(), asked.size());
      joined.middleCols(from, count) = more;
    };
    if (asked.want_clearances) {
      join(block.clearances, piece.clearances);
      join(block.conormals, piece.conormals);
    }
  });
  return all;
}

void BatchParts::Take(const Answers& answers) {
  answers_ = With(answers);
  first_ += part_.size();
  Cut();
}

}  // namespace stellate::core
