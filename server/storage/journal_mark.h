#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/status.h"

namespace stellate::server {

// How far a journal got: a small file next to it, written after each transaction and before anyone
// hears of that. SQLite takes a damaged end of its log for one that was never written; a journal
// that is behind its mark gives that away. The mark itself may lag: its writes are not waited for
// until Sync, so that it outlives the server immediately, and the machine a moment later.
class JournalMark {
 public:
  struct State {
    std::uint64_t identity = 0;  // of the journal
    std::uint64_t commits = 0;   // transactions of the journal that are on the disk
  };

  // A new file at `path`, on the disk once this returns.
  static core::Status Make(const std::string& path, const State& state);
  // Null: there is no such file. kFailedPrecondition: it is no mark, or cannot be read.
  static core::Expected<std::unique_ptr<JournalMark>> Open(const std::string& path);
  ~JournalMark();
  JournalMark(const JournalMark&) = delete;
  JournalMark& operator=(const JournalMark&) = delete;

  const State& state() const { return state_; }
  // False: not written; errno says why. The file tells an earlier state, or this.
  bool Write(const State& state);
  bool Sync();  // does nothing when nothing was written

 private:
  explicit JournalMark(int file) : file_(file) {}
  const int file_;
  State state_;
  int next_slot_ = 0;
  bool unsynced_ = false;
};

}  // namespace stellate::server
