#pragma once

#include "shared/errors.h"
#include "stellate/error.h"

namespace stellate::cli {

// Exit statuses of every command; those of every other client's, too.
inline constexpr int kExitCertified = shared::kExitWell;  // or simply: done
inline constexpr int kExitNotCertified = shared::kExitNotCertified;
inline constexpr int kExitRefused = shared::kExitRefused;  // usage, a request, a file
inline constexpr int kExitFailed = shared::kExitFailed;    // the server or the oracle

inline int ExitStatusOf(const Error& error) {
  const bool ours = error.code == ErrorCode::kRefused || error.code == ErrorCode::kFileFailed;
  return ours ? kExitRefused : kExitFailed;
}

}  // namespace stellate::cli
