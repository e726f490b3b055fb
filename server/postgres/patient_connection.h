#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "server/base/clock.h"
#include "server/postgres/connection.h"

namespace stellate::server {

// A connection that is opened again where it breaks, and waits where the database is away: a
// statement that may be repeated is run until it is done. One thread at a time.
class PatientConnection {
 public:
  // `patience`: for how long a statement waits for the database.
  PatientConnection(std::string url, Clock::duration patience)
      : url_(std::move(url)), patience_(patience) {}

  // False: the database refuses the statement, or was away for too long; trouble() says why.
  bool Run(const char* sql, const Parameters& parameters, Rows* rows);
  // No Run waits any longer: it tries once. Any thread.
  void StopWaiting() { stopping_ = true; }

  struct Trouble {
    bool full = false;  // the database's disk is
    std::string message;
  };
  const Trouble& trouble() const { return trouble_; }

 private:
  Connection::Outcome TryRun(const char* sql, const Parameters& parameters, Rows* rows);
  void NoteAbsence(bool away);
  void Rest() const;
  bool GiveUp(const std::string& why);

  const std::string url_;
  const Clock::duration patience_;
  std::unique_ptr<Connection> connection_;  // null: broken
  std::atomic<bool> stopping_{false};
  std::optional<TimePoint> away_since_;
  Trouble trouble_;
};

}  // namespace stellate::server
