#include "server/storage/records.h"

namespace stellate::server {

bool StoredMesh::Note(const Place& place, std::string_view record) {
  switch (place.kind) {
    case RecordKind::kStart:
      start = record;
      return true;
    case RecordKind::kEnd:
      end = record;
      return true;
    case RecordKind::kResult:
      result = record;
      return true;
    case RecordKind::kRound: {
      const auto round = DecodeRound(record);
      if (!round || place.number < 1) return false;
      const auto number = static_cast<std::uint64_t>(place.number);
      if (number > rounds) {
        rounds = number;
        last = round->standing;
      }
      return true;
    }
    case RecordKind::kAnswers:
      has_answers = true;
      return true;
    case RecordKind::kHistoryPart:
      has_history = true;
      return true;
    case RecordKind::kRemoved:
      removed = true;
      return true;
    case RecordKind::kState:
      break;
  }
  return false;
}

KindRange RangeOf(Records::Kinds kinds) {
  switch (kinds) {
    case Records::Kinds::kRounds:
      return {RecordKind::kRound, RecordKind::kAnswers};
    case Records::Kinds::kHistory:
      return {RecordKind::kHistoryPart, RecordKind::kHistoryPart};
    case Records::Kinds::kAll:
      break;
  }
  return {RecordKind::kState, RecordKind::kRemoved};
}

}  // namespace stellate::server
