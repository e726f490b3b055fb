#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/batch.h"
#include "server/session/session.h"
#include "server/session/session_journal.h"

namespace stellate::server {

// What a journal's records hold. A change of any of these is a new kJournalVersion.
inline constexpr std::uint32_t kJournalVersion = 21;

// Where a record belongs. Numbers are stored: they stay as they are.
enum class RecordKind : std::int64_t {
  kState = 0,        // of the whole journal; mesh 0
  kStart = 1,        // what a mesh was asked to be
  kEnd = 2,          // how it ended
  kRound = 3,        // round `number` is answered whole
  kAnswers = 4,      // some answers of round `number`: parts 0, 1, ...
  kResult = 5,       // what became of it: with this, its rounds are not needed any more
  kHistoryPart = 6,  // of its history, as bytes: parts 0, 1, ...
  kRemoved = 7,      // it was deleted, and lacks records
};
struct Place {
  std::int64_t mesh = 0;
  RecordKind kind = RecordKind::kState;
  std::int64_t number = 0;
  std::int64_t part = 0;

  auto operator<=>(const Place&) const = default;
};

// Changed by any damage to a record, and by reading it in another place.
std::uint64_t SealOf(std::string_view record, const Place& place);

// Tells journals apart, and of one journal an earlier state from a later one. With `sum`, that of
// the seals of all records but this one, no record can be lost or changed unseen.
struct JournalState {
  std::uint64_t identity = 0;
  std::uint64_t commits = 0;  // transactions so far
  std::int64_t next_mesh = 1;
  std::uint64_t records = 0;
  std::uint64_t sum = 0;  // modulo 2^64

  bool operator==(const JournalState&) const = default;
};
std::string EncodeState(const JournalState& state);
std::optional<JournalState> DecodeState(std::string_view record);

// Name, owner, label, the oracle's words, names of regions, scale, specification, the three times
// that a client may ask for, what was declared of points, and the trace. What the server decides
// (chunk sizes, numbers of workers) is not recorded: the next server may decide otherwise.
std::string EncodeStart(const MeshRequest& request,
                        std::chrono::system_clock::time_point create_time);
// False: no such record.
bool DecodeStart(std::string_view record, MeshRequest* request,
                 std::chrono::system_clock::time_point* create_time);

// Queries [first, end) of a block.
struct AnswerRange {
  std::size_t block = 0;
  Eigen::Index first = 0, end = 0;

  auto operator<=>(const AnswerRange&) const = default;
};
// Ascending, with neighbours made one.
std::vector<AnswerRange> Merged(std::vector<AnswerRange> ranges);
// What `ranges`, as Merged gives them, lack of blocks of these sizes.
std::vector<AnswerRange> Missing(const std::vector<AnswerRange>& ranges,
                                 const std::vector<Eigen::Index>& sizes);

// The answers of these ranges in records of about a megabyte, one after the other to `take`, until
// it returns false, as this does then. `questions`: DigestOf the batch.
bool EncodeAnswers(const core::Answers& answers, const std::vector<AnswerRange>& ranges,
                   std::uint64_t questions, const std::function<bool(const std::string&)>& take);
struct RecordedAnswers {
  std::uint64_t questions = 0;
  std::vector<PartOfRound> parts;
};
std::optional<RecordedAnswers> DecodeAnswers(std::string_view record);

struct RecordedRound {
  std::uint64_t questions = 0;  // DigestOf the batch
  std::uint64_t answers = 0;    // DigestOf all of them
  std::uint64_t parts = 0;      // records that hold them
  Standing standing;
};
std::string EncodeRound(const RecordedRound& round);
std::optional<RecordedRound> DecodeRound(std::string_view record);

std::string EncodeEnd(const SessionEnd& end);
std::optional<SessionEnd> DecodeEnd(std::string_view record);

std::string EncodeResult(const SessionResult& result, std::uint64_t parts);
std::optional<SessionResult> DecodeResult(std::string_view record, std::uint64_t* parts);

// Tells whether a mesher asks what it asked before.
std::uint64_t DigestOf(const core::QueryBatch& batch);
std::uint64_t DigestOf(const core::Answers& answers);

}  // namespace stellate::server
