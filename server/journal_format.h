#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/batch.h"
#include "server/session.h"
#include "server/session_journal.h"

namespace stellate::server {

// How a journal's records are laid out: little-endian numbers of 8 bytes, strings and arrays after
// their sizes. A change of any of these is a new kJournalVersion.
inline constexpr std::uint32_t kJournalVersion = 5;

// Name, owner, label, specification, and the two times that a client may ask for. What the server
// decides (chunk sizes, numbers of workers) is not recorded: the next server may decide otherwise.
std::string EncodeStart(const SessionOptions& options,
                        std::chrono::system_clock::time_point create_time);
// False: no such record.
bool DecodeStart(std::string_view record, SessionOptions* options,
                 std::chrono::system_clock::time_point* create_time);

std::string EncodeAnswers(const core::Answers& answers);
std::optional<core::Answers> DecodeAnswers(std::string_view record);

std::string EncodeEnd(const SessionEnd& end);
std::optional<SessionEnd> DecodeEnd(std::string_view record);
// The end of a mesh that is being removed, and may lack rounds. So long ago that a server to which
// it meant nothing would keep it no longer.
SessionEnd RemovedEnd();
bool IsRemoved(const SessionEnd& end);

// Tells whether a mesher asks what it asked before.
std::uint64_t DigestOf(const core::QueryBatch& batch);

// Eight bytes to follow a record: changed by any damage to it, and by reading it in another place
// than the one that `place` names. Guards against disks, not against forgers.
std::string SealOf(std::string_view record, std::string_view place);
// The record without its seal; nothing if it is damaged or out of place.
std::optional<std::string_view> Unseal(std::string_view sealed, std::string_view place);

}  // namespace stellate::server
