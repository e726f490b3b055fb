#include "shared_questions.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "core/base/parcel.h"
#include "core/base/random.h"
#include "run/answer_chunk.h"
#include "server/convert/oracle.h"
#include "server/oracles/answer_check.h"

namespace stellate::mpi {
namespace {

using core::Pack;
using core::Parcel;
using Bytes = core::Peers::Bytes;
using Eigen::Index;

constexpr std::size_t kCallBytes = std::size_t{3} << 20;  // of numbers, in one call of an oracle

Index MostInACall(const core::Specification& spec, std::optional<std::uint32_t> most) {
  const auto d = static_cast<std::size_t>(spec.ambient_dimension);
  const auto numbers = d * static_cast<std::size_t>(1 + spec.dimension + spec.walls) + 2;
  const std::size_t room = std::max<std::size_t>(1, kCallBytes / (8 * numbers));
  return static_cast<Index>(std::min<std::size_t>(room, most.value_or(room)));
}

// Tells batches apart, to the last bit of each number.
std::uint64_t DigestOf(const core::QueryBatch& batch) {
  std::uint64_t digest = core::Mix64(batch.round);
  const auto add = [&digest](const Eigen::MatrixXd& numbers) {
    for (Index i = 0; i < numbers.size(); ++i)
      digest = core::Mix64(digest ^ std::bit_cast<std::uint64_t>(numbers.data()[i]));
  };
  for (const core::QueryBlock& block : batch.blocks) {
    digest = core::Mix64(digest ^ static_cast<std::uint64_t>(block.size()));
    add(block.points);
    add(block.bases);
    add(block.radii);
  }
  return digest;
}

void Pack(const std::string& words, Bytes* message) {
  Pack(words.size(), message);
  Pack(std::span<const char>(words), message);
}
std::string UnpackWords(Parcel* parcel) {
  std::string words(parcel->Unpack<std::size_t>(), ' ');
  parcel->Unpack(words.size(), words.data());
  return words;
}

// An array with its shape; it may be missing.
template <typename Array>
void PackArray(const Array& array, Bytes* message) {
  Pack(core::columns::Rows(array), message);
  Pack(core::columns::Count(array), message);
  Pack(std::span(array.data(), static_cast<std::size_t>(array.size())), message);
}
template <typename Array>
void UnpackArray(Parcel* parcel, Array* array) {
  const auto rows = parcel->Unpack<Index>(), count = parcel->Unpack<Index>();
  if constexpr (std::is_same_v<Array, Eigen::MatrixXd>)
    array->resize(rows, count);
  else
    array->resize(static_cast<std::size_t>(count));
  parcel->Unpack(static_cast<std::size_t>(array->size()), array->data());
}

// Takes the answers of a part, or why it has none.
std::optional<server::MeshFailure> Take(const Bytes& message, std::size_t part,
                                        core::Answers* answers) {
  Parcel parcel(message);
  parcel.Unpack<std::uint64_t>();  // the digest
  const auto reason = parcel.Unpack<server::FailureReason>();
  if (reason != server::FailureReason::kNone)
    return server::MeshFailure{reason, core::Message("rank ", part, ": ", UnpackWords(&parcel))};
  while (!parcel.is_empty()) {
    server::PartOfRound some;
    some.block_index = parcel.Unpack<std::size_t>();
    some.first = parcel.Unpack<Index>();
    core::AnswerBlock::ForEachField(
        [&](auto field) { UnpackArray(&parcel, &(some.answers.*field)); });
    server::PutAnswers(some, answers);
  }
  return std::nullopt;
}

}  // namespace

struct SharedQuestions::Piece {
  std::size_t block;
  Index first, count;
  core::AnswerBlock answers{};
};

SharedQuestions::SharedQuestions(const core::Specification& spec, Oracle& oracle,
                                 const core::Peers& peers, int workers,
                                 std::optional<std::uint32_t> most)
    : spec_(spec),
      oracle_(oracle),
      peers_(peers),
      workers_(static_cast<std::size_t>(std::max(workers, 1))),
      most_(MostInACall(spec, most)) {}

// Shares move on by one part each round, so that what is asked again to see whether the answer is
// the same is mostly asked of another oracle.
std::vector<SharedQuestions::Piece> SharedQuestions::OwnPieces(
    const core::QueryBatch& batch) const {
  const Index parts = peers_.parts();
  const Index share = static_cast<Index>((static_cast<std::uint64_t>(peers_.part()) + batch.round) %
                                         static_cast<std::uint64_t>(parts));
  std::vector<Piece> pieces;
  for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
    const Index n = batch.blocks[b].size(), end = n * (share + 1) / parts;
    Index most = most_;
    if (workers_ > 1)  // some for each
      most = std::min(most, std::max<Index>(1, n / parts / static_cast<Index>(4 * workers_)));
    for (Index first = n * share / parts; first < end; first += most)
      pieces.push_back({b, first, std::min(most, end - first)});
  }
  return pieces;
}

std::optional<server::MeshFailure> SharedQuestions::Answer(
    const std::shared_ptr<server::Round>& round, Piece* piece) const {
  using server::FailureReason;
  server::Chunk chunk;
  chunk.round = round;
  chunk.block_index = piece->block;
  chunk.first = piece->first;
  chunk.count = piece->count;
  v1::QueryChunk asked;
  v1::AnswerChunk said;
  server::ToProto(chunk, spec_, &asked);
  try {
    if (!client::AnswerChunk(oracle_, asked, &said))
      return server::MeshFailure{FailureReason::kInternal, "queries that make no sense"};
  } catch (const OracleError& error) {
    return server::MeshFailure{
        server::FailureReasonOf(error.reason()).value_or(FailureReason::kOracleFailed),
        error.what()};
  } catch (const std::exception& error) {
    return server::MeshFailure{FailureReason::kOracleFailed, error.what()};
  }
  auto answers = server::FromProto(said, chunk, spec_);
  if (!answers) return server::ToMeshFailure(answers.error());
  if (const server::Refused refused = server::CheckAnswer(spec_, chunk, *answers); !refused.ok())
    return server::ToMeshFailure(refused);
  piece->answers = std::move(*answers);
  return std::nullopt;
}

std::optional<server::MeshFailure> SharedQuestions::AnswerAll(
    const std::shared_ptr<server::Round>& round, std::vector<Piece>* pieces) const {
  std::vector<std::optional<server::MeshFailure>> failures(pieces->size());
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> has_failed = false;
  const auto work = [&] {
    for (std::size_t i = next++; i < pieces->size() && !has_failed; i = next++) {
      failures[i] = Answer(round, &(*pieces)[i]);
      if (failures[i]) has_failed = true;
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < std::min(workers_, pieces->size()); ++i) others.emplace_back(work);
    work();
  }
  for (auto& failure : failures)
    if (failure) return std::move(failure);
  return std::nullopt;
}

SharedQuestions::Outcome SharedQuestions::Ask(
    const std::shared_ptr<const core::QueryBatch>& batch) const {
  const auto round = std::make_shared<server::Round>();
  round->batch = batch;
  std::vector<Piece> pieces = OwnPieces(*batch);
  const std::optional<server::MeshFailure> own = AnswerAll(round, &pieces);
  const std::uint64_t digest = DigestOf(*batch);
  Bytes message;
  Pack(digest, &message);
  Pack(own ? own->reason : server::FailureReason::kNone, &message);
  if (own) {
    Pack(own->message, &message);
  } else {
    for (const Piece& piece : pieces) {
      Pack(piece.block, &message);
      Pack(piece.first, &message);
      core::AnswerBlock::ForEachField(
          [&](auto field) { PackArray(piece.answers.*field, &message); });
    }
  }
  pieces.clear();
  const std::vector<Bytes> all = peers_.ToAll(std::move(message));

  Outcome outcome;
  const auto is_other = [digest](const Bytes& its) {
    return Parcel(its).Unpack<std::uint64_t>() != digest;
  };
  if (std::any_of(all.begin(), all.end(), is_other)) {
    outcome.failure = {server::FailureReason::kInternal,
                       core::Message("the ranks ask different questions in round ", batch->round,
                                     ": their processors or libraries compute differently; run all "
                                     "of them on machines of one kind")};
    return outcome;
  }
  outcome.answers = server::EmptyAnswers(spec_.dimension, *batch, spec_.walls);
  for (std::size_t part = 0; part < all.size(); ++part) {
    outcome.failure = Take(all[part], part, &outcome.answers);
    if (outcome.failure) break;
  }
  return outcome;
}

}  // namespace stellate::mpi
