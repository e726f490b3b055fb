#include "server/storage/journal_mark.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "core/base/message.h"
#include "server/records/journal_format.h"
#include "server/records/record_bytes.h"

namespace stellate::server {
namespace {

using core::Message;
using core::StatusCode;

// Two places in turn, each in a sector of its own, so that a write that is cut off leaves the one
// before it.
constexpr int kSlots = 2;
constexpr std::size_t kSlotBytes = 512;
constexpr std::uint64_t kMarkMagic = 0x6b72614d6c740000 + kJournalVersion;

using Words = std::array<std::uint64_t, 4>;

Words ToWords(const JournalMark::State& state) {
  Words words{kMarkMagic, state.identity, state.commits, 0};
  RecordDigest digest;
  digest.Add(words.data(), 3 * kWord);
  words[3] = digest.value();
  return words;
}

std::optional<JournalMark::State> FromWords(const Words& words) {
  const JournalMark::State state{words[1], words[2]};
  return ToWords(state) == words ? std::optional(state) : std::nullopt;
}

bool WriteSlot(int file, int slot, const JournalMark::State& state) {
  const Words words = ToWords(state);
  const auto at = static_cast<off_t>(slot * kSlotBytes);
  ssize_t written = 0;
  do {
    written = pwrite(file, words.data(), sizeof(words), at);
  } while (written < 0 && errno == EINTR);
  return written == sizeof(words);
}

core::Status CannotWrite(const std::string& path) {
  return {StatusCode::kFailedPrecondition,
          Message("cannot write ", path, ": ", std::strerror(errno))};
}

}  // namespace

JournalMark::~JournalMark() {
  Sync();
  close(file_);
}

core::Status JournalMark::Make(const std::string& path, const State& state) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) return CannotWrite(path);
  bool made = true;
  for (int slot = 0; slot < kSlots; ++slot) made = made && WriteSlot(file, slot, state);
  core::Status status = made && fsync(file) == 0 ? core::Status::Ok() : CannotWrite(path);
  close(file);
  return status;
}

core::Expected<std::unique_ptr<JournalMark>> JournalMark::Open(const std::string& path) {
  const int file = open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (file < 0 && errno == ENOENT) return nullptr;
  if (file < 0) {
    return core::Refuse(StatusCode::kFailedPrecondition,
                        Message("cannot read ", path, ": ", std::strerror(errno)));
  }
  std::unique_ptr<JournalMark> mark(new JournalMark(file));
  bool good = false;
  for (int slot = 0; slot < kSlots; ++slot) {
    Words words{};
    if (pread(file, words.data(), sizeof(words), static_cast<off_t>(slot * kSlotBytes)) !=
        sizeof(words)) {
      continue;
    }
    const auto state = FromWords(words);
    if (!state || (good && state->commits <= mark->state_.commits)) continue;
    mark->state_ = *state;
    mark->next_slot_ = (slot + 1) % kSlots;
    good = true;
  }
  if (good) return mark;
  return core::Refuse(StatusCode::kFailedPrecondition,
                      Message(path, " is damaged: it tells how far the journal got"));
}

bool JournalMark::Write(const State& state) {
  if (!WriteSlot(file_, next_slot_, state)) return false;
  next_slot_ = (next_slot_ + 1) % kSlots;
  state_ = state;
  unsynced_ = true;
  return true;
}

bool JournalMark::Sync() {
  if (unsynced_ && fdatasync(file_) != 0) return false;
  unsynced_ = false;
  return true;
}

}  // namespace stellate::server
