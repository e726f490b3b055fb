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
  std::string server;           // where it listens: tells this one to those that stand by
  std::uint64_t max_bytes = 0;  // of all records; 0: no limit but the database's
  Clock::duration patience = std::chrono::hours(1);  // how long a call waits for the database
  // Called with whether the database answers while this waits for it; may be empty.
  std::function<void(bool)> on_answer = {};
};

// Opens the records in a database of PostgreSQL, once it answers, and no other server has it: until
// then this stands by, unless `give_up` says so. kInvalidArgument: the setting; kCancelled: it gave
// up; kFailedPrecondition: the database, or this server was built without.
core::Expected<std::unique_ptr<Records>> OpenDatabase(const DatabaseOptions& options,
                                                      const std::function<bool()>& give_up);

}  // namespace stellate::server
