#include "server/postgres/database_lease.h"

#include <condition_variable>
#include <mutex>
#include <optional>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/postgres/schema.h"
#include "server/records/journal_format.h"

namespace stellate::server {
namespace {

using core::Message;
using core::StatusCode;
using Outcome = Connection::Outcome;

constexpr auto kPause = std::chrono::milliseconds(250);
constexpr auto kSilence = 3 * kBeat;  // of a database, until it counts as away

constexpr char kSee[] =
    "SELECT term, beats, held, holder, format, EXISTS (SELECT FROM stellate.records) "
    "FROM stellate.cluster";
constexpr char kTake[] =
    "UPDATE stellate.cluster SET term = term + 1, beats = 0, held = true, holder = $3, "
    "format = $4 WHERE term = $1 AND beats = $2 RETURNING term";
constexpr char kBeatOnce[] =
    "UPDATE stellate.cluster SET beats = beats + 1 WHERE term = $1 RETURNING term";
constexpr char kRelease[] = "UPDATE stellate.cluster SET held = false WHERE term = $1";

struct Sight {
  std::int64_t term = 0, beats = 0;
  bool held = false;
  std::string holder;
  std::int64_t format = 0;
  bool has_records = false;
};

std::optional<Sight> See(Connection* connection, const std::atomic<bool>& stop) {
  Rows rows;
  if (connection->Run(kSee, {}, &rows, stop) != Outcome::kDone || rows.count() != 1) return {};
  return Sight{rows.Number(0, 0), rows.Number(0, 1), rows.Flag(0, 2), std::string(rows.Bytes(0, 3)),
               rows.Number(0, 4), rows.Flag(0, 5)};
}

// What stands by until it may take the database.
class Watch {
 public:
  Watch(std::string url, const DatabaseLease::Options& options)
      : url_(std::move(url)), options_(options) {}

  // The first connection, and the tables: waits for a database that is not there yet.
  core::Status Begin(const std::function<bool()>& give_up) {
    const TimePoint began = Clock::now();
    core::Status status = Open();
    for (bool has_said = false; !status.ok(); status = Open()) {
      connection_.reset();
      if (!Connection::IsAway(url_)) return status;
      Note(false);
      const std::chrono::duration<double> waited = Clock::now() - began, most = options_.patience;
      if (waited >= most) {
        return {StatusCode::kFailedPrecondition,
                Message("the database of --database has not answered for ", waited.count(),
                        " seconds (--database-patience): ", status.message)};
      }
      if (!std::exchange(has_said, true)) {
        Log(LogLevel::kError, {},
            Message("waiting for the database, up to ", most.count(),
                    " seconds: ", status.message));
      }
      std::this_thread::sleep_for(kPause);
      if (give_up()) return {StatusCode::kCancelled, "stopped while the database was away"};
    }
    Note(true);
    return status;
  }

  core::Status Open() {
    auto opened = Connection::Open(url_);
    if (!opened) {
      return {StatusCode::kFailedPrecondition,
              Message("the database of --database cannot be opened: ", opened.error().message)};
    }
    connection_ = std::move(*opened);
    return PrepareSchema(connection_.get());
  }

  // The term, once it is this server's.
  core::Expected<std::optional<std::int64_t>> TryTake() {
    if (connection_ == nullptr && !Open().ok()) connection_.reset();
    const auto now = connection_ == nullptr ? std::nullopt : See(connection_.get(), never_);
    Note(now.has_value());
    if (!now) {
      connection_.reset();
      seen_.reset();  // silence counts while the database answers
      return std::nullopt;
    }
    if (now->has_records && now->format != kJournalVersion) return OtherFormat(now->format);
    const TimePoint time = Clock::now();
    if (!seen_ || seen_->term != now->term || seen_->beats != now->beats) since_ = time;
    seen_ = now;
    if (now->held && time - since_ < kLease) {
      if (!std::exchange(has_spoken_, true)) {
        Log(LogLevel::kInfo, {}, Message("another server has the database: standing by"),
            LogFields().Add("holder", now->holder));
      }
      return std::nullopt;
    }
    Rows taken;
    const Outcome outcome = connection_->Run(kTake,
                                             Parameters()
                                                 .Add(now->term)
                                                 .Add(now->beats)
                                                 .Add(options_.name)
                                                 .Add(std::int64_t{kJournalVersion}),
                                             &taken, never_);
    if (outcome == Outcome::kFault || outcome == Outcome::kFull) {
      return core::Refuse(
          StatusCode::kFailedPrecondition,
          Message("the database of --database cannot be written: ", connection_->error()));
    }
    if (outcome != Outcome::kDone || taken.count() != 1) return std::nullopt;
    return taken.Number(0, 0);
  }

  std::unique_ptr<Connection> TakeConnection() { return std::move(connection_); }

 private:
  static tl::unexpected<core::Status> OtherFormat(std::int64_t format) {
    return core::Refuse(
        StatusCode::kFailedPrecondition,
        Message("the database of --database has records of version ", format,
                " but this server reads version ", std::to_string(kJournalVersion),
                "; they were left as they are: let the server that wrote them end its meshes and "
                "delete them, or choose another database"));
  }

  void Note(bool answers) const {
    if (options_.on_answer) options_.on_answer(answers);
  }

  const std::string url_;
  const DatabaseLease::Options& options_;
  const std::atomic<bool> never_{false};
  std::unique_ptr<Connection> connection_;
  std::optional<Sight> seen_;
  TimePoint since_;  // when it was first seen so
  bool has_spoken_ = false;
};

}  // namespace

core::Expected<std::unique_ptr<DatabaseLease>> DatabaseLease::Take(
    const std::string& url, const Options& options, const std::function<bool()>& give_up) {
  Watch watch(url, options);
  core::Status status = watch.Begin(give_up);
  if (!status.ok()) return tl::unexpected(std::move(status));
  while (!give_up()) {
    const auto term = watch.TryTake();
    if (!term) return tl::unexpected(term.error());
    if (*term)
      return std::unique_ptr<DatabaseLease>(new DatabaseLease(url, watch.TakeConnection(), **term));
    std::this_thread::sleep_for(kPause);
  }
  return core::Refuse(StatusCode::kCancelled, "stopped while another server had the database");
}

DatabaseLease::DatabaseLease(std::string url, std::unique_ptr<Connection> connection,
                             std::int64_t term)
    : url_(std::move(url)),
      connection_(std::move(connection)),
      term_(term),
      beating_([this](const std::stop_token& stop) { Beat(stop); }) {}

DatabaseLease::~DatabaseLease() {
  stopping_ = true;
  beating_.request_stop();
  beating_.join();
  if (lost_ || connection_ == nullptr) return;
  const std::atomic<bool> never{false};
  connection_->Run(kRelease, Parameters().Add(term_), nullptr, never);
}

void DatabaseLease::NoteLoss() {
  if (lost_.exchange(true)) return;
  Log(LogLevel::kError, {},
      "another server has taken the database and the meshes that are in it: this one writes no "
      "more");
}

bool DatabaseLease::IsAnswered() const { return Clock::now() - last_beat_.load() < kSilence; }

// A beat that the database does not take is tried again with the next.
void DatabaseLease::Beat(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  while (!wake.wait_for(lock, stop, kBeat, [&stop] { return stop.stop_requested(); })) {
    if (connection_ == nullptr) {
      auto opened = Connection::Open(url_);
      if (!opened) continue;
      connection_ = std::move(*opened);
    }
    Rows rows;
    const Outcome outcome = connection_->Run(kBeatOnce, Parameters().Add(term_), &rows, stopping_);
    if (outcome != Outcome::kDone) {
      connection_.reset();
    } else if (rows.count() == 0) {
      return NoteLoss();
    } else {
      last_beat_ = Clock::now();
    }
  }
}

}  // namespace stellate::server
