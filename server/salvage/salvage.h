#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// What stellated does with a data directory instead of serving it. Both say what they found, in
// lines for people, and refuse a directory in use, or without a journal.

// Reads every record and changes nothing. kFailedPrecondition: something is damaged, or it is of
// another version.
core::Expected<std::string> VerifyDataDir(const std::string& path);

// Begins a new journal with all that can be read, in the place of a damaged one, which is kept in a
// directory beside it, damaged-1, -2, .... A journal that is sound stays as it is.
core::Expected<std::string> SalvageDataDir(const std::string& path);

}  // namespace stellate::server
