#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/status.h"
#include "server/base/clock.h"
#include "server/storage/records.h"

namespace stellate::server {

struct DatabaseOptions {
  std::string setting;          // of --database: a URL, or a file that holds one
  std::uint64_t max_bytes = 0;  // of all records; 0: no limit but the database's
  Clock::duration patience = std::chrono::hours(1);  // how long a call waits for the database
  // Called with whether the database answers while this waits for it; may be empty.
  std::function<void(bool)> on_answer = {};
  bool alone = false;  // waits until no other server is there
};

// Opens the records in a database of PostgreSQL, which other servers may share, once it answers,
// unless `give_up` says so. kInvalidArgument: the setting; kCancelled: it gave
// up; kFailedPrecondition: the database, or this server was built without.
core::Expected<std::unique_ptr<Records>> OpenDatabase(const DatabaseOptions& options,
                                                      const std::function<bool()>& give_up);

}  // namespace stellate::server
