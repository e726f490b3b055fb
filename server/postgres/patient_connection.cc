#include "server/postgres/patient_connection.h"

#include <thread>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;
using Outcome = Connection::Outcome;

constexpr auto kRest = std::chrono::milliseconds(100);  // before the database is asked again

}  // namespace

void PatientConnection::Rest() const {
  const TimePoint until = Clock::now() + kRest;
  while (!stopping_ && Clock::now() < until) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

void PatientConnection::NoteAbsence(bool away) {
  if (away == away_since_.has_value()) return;
  if (away) {
    away_since_ = Clock::now();
    Log(LogLevel::kError, {},
        Message("the database does not answer, and meshes wait for it: ", trouble_.message));
  } else {
    const std::chrono::duration<double> waited = Clock::now() - *away_since_;
    away_since_.reset();
    Log(LogLevel::kInfo, {}, "the database is back", LogFields().Add("seconds", waited.count()));
  }
}

Outcome PatientConnection::TryRun(const char* sql, const Parameters& parameters, Rows* rows) {
  if (connection_ == nullptr) {
    auto opened = Connection::Open(url_);
    if (!opened) {
      trouble_ = {false, opened.error().message};
      return Outcome::kAway;
    }
    connection_ = std::move(*opened);
  }
  const Outcome outcome = connection_->Run(sql, parameters, rows, stopping_);
  if (outcome != Outcome::kDone) trouble_ = {outcome == Outcome::kFull, connection_->error()};
  if (outcome == Outcome::kAway) connection_.reset();
  return outcome;
}

bool PatientConnection::GiveUp(const std::string& why) {
  trouble_.message = Message(why, ": ", trouble_.message);
  return false;
}

bool PatientConnection::Run(const char* sql, const Parameters& parameters, Rows* rows) {
  while (true) {
    const Outcome outcome = TryRun(sql, parameters, rows);
    NoteAbsence(outcome == Outcome::kAway);
    if (outcome == Outcome::kDone) return true;
    if (outcome != Outcome::kAway) return false;
    if (stopping_) return GiveUp("the server stops");
    const auto waited = Clock::now() - *away_since_;
    if (waited >= patience_) {
      const std::chrono::duration<double> seconds = waited;
      return GiveUp(Message("the database has not answered for ", seconds.count(),
                            " seconds (--database-patience)"));
    }
    Rest();
  }
}

}  // namespace stellate::server
