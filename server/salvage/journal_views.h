#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// What a damaged journal may have held. SQLite reads a log up to the first bad frame; a view has
// the frames behind it too. What of it can be believed its records' seals tell.
struct JournalView {
  bool with_log = true;            // the log's frames, up to its last commit
  bool good_frames_alone = false;  // those whose own sum is right
  bool new_first_page = false;     // that of a journal with nothing in it
};

// Makes one at `path`, to be read without a log. `blank`: a sound journal with nothing in it.
core::Status MakeJournalView(const JournalView& view, const std::string& journal,
                             const std::string& log, const std::string& blank,
                             const std::string& path);

}  // namespace stellate::server
