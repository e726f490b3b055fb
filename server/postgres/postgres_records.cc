#include "server/postgres/postgres_records.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;
using Outcome = Connection::Outcome;

// Sent at once. What a transaction has beyond that goes in several statements, the last record in
// the last: a round is there once its own record is, and that is put after its answers.
constexpr std::size_t kSentBytes = std::size_t{16} << 20;
constexpr std::int64_t kRemovedRecords = 16;            // at once: of a megabyte at most each
constexpr auto kRest = std::chrono::milliseconds(100);  // before the database is asked again

// The row is locked, so that a takeover waits for what is being written, and a write that came
// after it finds no row and does nothing. $1: the term.
#define STELLATE_HELD \
  "WITH held AS (SELECT term FROM stellate.cluster WHERE term = $1 FOR KEY SHARE), "

constexpr char kPut[] = STELLATE_HELD
    "put AS (INSERT INTO stellate.records AS r (mesh, kind, number, part, seal, bytes) "
    "SELECT p.mesh, p.kind, p.number, p.part, p.seal, p.bytes FROM held, "
    "unnest($2, $3, $4, $5, $6, $7) AS p (mesh, kind, number, part, seal, bytes) "
    "ON CONFLICT (mesh, kind, number, part) DO UPDATE SET seal = excluded.seal, "
    "bytes = excluded.bytes WHERE r.seal <> excluded.seal) "
    "SELECT count(*) FROM held";
constexpr char kRemove[] = STELLATE_HELD
    "gone AS (DELETE FROM stellate.records USING held WHERE mesh = $2 AND kind = $3 AND "
    "number = $4 AND part = $5) "
    "SELECT count(*) FROM held";
// The last rounds first: what is left has no gap. A mesh's mark is the last to go.
constexpr char kRemoveSome[] = STELLATE_HELD
    "gone AS (DELETE FROM stellate.records AS r USING held, "
    "(SELECT mesh, kind, number, part FROM stellate.records WHERE mesh = $2 AND kind BETWEEN $3 "
    "AND $4 ORDER BY number DESC, kind DESC, part DESC LIMIT $5) AS s "
    "WHERE (r.mesh, r.kind, r.number, r.part) = (s.mesh, s.kind, s.number, s.part)) "
    "SELECT count(*) FROM held";
constexpr char kMeasure[] =
    "SELECT coalesce(sum(octet_length(bytes)), 0)::int8, "
    "count(*) FILTER (WHERE kind BETWEEN $2 AND $3) FROM stellate.records WHERE mesh = $1";
constexpr char kRead[] =
    "SELECT seal, bytes FROM stellate.records WHERE mesh = $1 AND kind = $2 AND number = $3 AND "
    "part = $4";
constexpr char kList[] =
    "SELECT kind::int8, number, part::int8 FROM stellate.records WHERE mesh = $1 "
    "ORDER BY kind, number, part";
// Answers and histories are large: of them it is enough to know that there are some.
constexpr char kLoad[] =
    "SELECT mesh, kind::int8, number, part::int8, seal, bytes FROM stellate.records "
    "WHERE kind NOT IN ($1, $2) ORDER BY mesh, kind, number, part";
constexpr char kLoadSizes[] =
    "SELECT mesh, kind::int8, sum(octet_length(bytes))::int8 FROM stellate.records "
    "GROUP BY mesh, kind";
#undef STELLATE_HELD

std::int64_t Number(RecordKind kind) { return static_cast<std::int64_t>(kind); }

}  // namespace

core::Expected<std::unique_ptr<PostgresRecords>> PostgresRecords::Open(
    const std::string& url, std::unique_ptr<DatabaseLease> lease, const Options& options) {
  std::unique_ptr<PostgresRecords> records(new PostgresRecords(url, std::move(lease), options));
  core::Status status = records->Load();
  if (!status.ok()) return tl::unexpected(std::move(status));
  return records;
}

core::Status PostgresRecords::Load() {
  const auto fail = [](const std::string& why) {
    return core::Status{core::StatusCode::kFailedPrecondition,
                        Message("the records in the database of --database cannot be read: ", why)};
  };
  Rows rows;
  const auto answers = Number(RecordKind::kAnswers), history = Number(RecordKind::kHistoryPart);
  if (!Run(kLoad, Parameters().Add(answers).Add(history), &rows)) return fail(trouble_.message);
  for (int row = 0; row < rows.count(); ++row) {
    const Place place{rows.Number(row, 0), static_cast<RecordKind>(rows.Number(row, 1)),
                      rows.Number(row, 2), rows.Number(row, 3)};
    const std::string_view record = rows.Bytes(row, 5);
    if (SealOf(record, place) == static_cast<std::uint64_t>(rows.Number(row, 4)) &&
        meshes_[place.mesh].Note(place, record)) {
      continue;
    }
    return fail(Message("one of mesh ", place.mesh, ", of kind ", Number(place.kind),
                        " and number ", place.number,
                        ", is damaged; all were left as they are: restore the database, or give "
                        "the mesh up by DELETE FROM stellate.records WHERE mesh = ",
                        place.mesh));
  }
  if (!Run(kLoadSizes, {}, &rows)) return fail(trouble_.message);
  for (int row = 0; row < rows.count(); ++row) {
    const Place place{rows.Number(row, 0), static_cast<RecordKind>(rows.Number(row, 1)), 0, 0};
    const auto size = static_cast<std::uint64_t>(rows.Number(row, 2));
    StoredMesh& mesh = meshes_[place.mesh];
    mesh.bytes += size;
    bytes_[place.mesh] += size;
    total_bytes_ += size;
    next_mesh_ = std::max(next_mesh_, place.mesh + 1);
    if (Number(place.kind) == answers || Number(place.kind) == history) mesh.Note(place, "");
  }
  return core::Status::Ok();
}

void PostgresRecords::Clear() { put_ = {}; }

bool PostgresRecords::Fail(bool full, std::string message) {
  trouble_ = {full, std::move(message)};
  return false;
}

void PostgresRecords::Rest() const {
  const TimePoint until = Clock::now() + kRest;
  while (!stopping_ && Clock::now() < until) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

void PostgresRecords::NoteAbsence(bool away) {
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

Outcome PostgresRecords::TryRun(const char* sql, const Parameters& parameters, Rows* rows) {
  if (connection_ == nullptr) {
    auto opened = Connection::Open(url_);
    if (!opened) {
      Fail(false, opened.error().message);
      return Outcome::kAway;
    }
    connection_ = std::move(*opened);
  }
  const Outcome outcome = connection_->Run(sql, parameters, rows, stopping_);
  if (outcome != Outcome::kDone) Fail(outcome == Outcome::kFull, connection_->error());
  if (outcome == Outcome::kAway) connection_.reset();
  return outcome;
}

// Waits where the database is away, unless the server stops: then it tries once.
bool PostgresRecords::Run(const char* sql, const Parameters& parameters, Rows* rows) {
  while (true) {
    const Outcome outcome = TryRun(sql, parameters, rows);
    NoteAbsence(outcome == Outcome::kAway);
    if (outcome == Outcome::kDone) return true;
    if (outcome != Outcome::kAway) return false;
    if (stopping_) return Fail(false, Message("the server stops: ", trouble_.message));
    const auto waited = Clock::now() - *away_since_;
    if (waited >= options_.patience) {
      const std::chrono::duration<double> seconds = waited;
      return Fail(false, Message("the database has not answered for ", seconds.count(),
                                 " seconds (--database-patience): ", trouble_.message));
    }
    Rest();
  }
}

// A server whose lease is over must not tell anybody that its meshes fail: they go on elsewhere. It
// waits here until its streams have ended.
bool PostgresRecords::Write(const char* sql, const Parameters& parameters) {
  Rows rows;
  if (!Run(sql, parameters, &rows)) return false;
  if (rows.count() == 1 && rows.Number(0, 0) == 1) return true;
  lease_->NoteLoss();
  while (!stopping_) Rest();
  return Fail(false, "another server has taken the database");
}

bool PostgresRecords::Transact(const std::function<bool()>& action) {
  Clear();
  return action() && SendPut();
}

bool PostgresRecords::Put(const Place& place, std::string_view record) {
  put_.mesh.push_back(place.mesh);
  put_.kind.push_back(Number(place.kind));
  put_.number.push_back(place.number);
  put_.part.push_back(place.part);
  put_.seal.push_back(static_cast<std::int64_t>(SealOf(record, place)));
  put_.bytes.emplace_back(record);
  put_.size += record.size();
  return put_.size < kSentBytes || SendPut();
}

bool PostgresRecords::SendPut() {
  if (put_.mesh.empty()) return true;
  if (options_.max_bytes > 0 && total_bytes_ + put_.size > options_.max_bytes) {
    return Fail(true, Message("its records have ", total_bytes_, " bytes of the ",
                              options_.max_bytes, " of --max-journal-bytes"));
  }
  const Parameters parameters = Parameters()
                                    .Add(lease_->term())
                                    .Add(put_.mesh)
                                    .Add(put_.kind)
                                    .Add(put_.number)
                                    .Add(put_.part)
                                    .Add(put_.seal)
                                    .AddBytes(put_.bytes);
  if (!Write(kPut, parameters)) return false;
  for (std::size_t i = 0; i < put_.mesh.size(); ++i) bytes_[put_.mesh[i]] += put_.bytes[i].size();
  total_bytes_ += put_.size;
  Clear();
  return true;
}

// Asks anew, so that what was repeated counts once.
bool PostgresRecords::Measure(std::int64_t mesh, KindRange kinds, std::int64_t* records) {
  Rows rows;
  const auto parameters = Parameters().Add(mesh).Add(Number(kinds.first)).Add(Number(kinds.last));
  if (!Run(kMeasure, parameters, &rows)) return false;
  const auto bytes = static_cast<std::uint64_t>(rows.Number(0, 0));
  total_bytes_ += bytes - std::exchange(bytes_[mesh], bytes);
  if (bytes == 0) bytes_.erase(mesh);
  *records = rows.Number(0, 1);
  return true;
}

bool PostgresRecords::Remove(const Place& place) {
  std::int64_t left = 0;
  return Write(kRemove, Parameters()
                            .Add(lease_->term())
                            .Add(place.mesh)
                            .Add(Number(place.kind))
                            .Add(place.number)
                            .Add(place.part)) &&
         Measure(place.mesh, {place.kind, place.kind}, &left);
}

bool PostgresRecords::RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) {
  const KindRange range = RangeOf(kinds);
  std::int64_t left = 0;
  if (!Measure(mesh, range, &left)) return false;
  *done = left == 0;
  if (*done) return true;
  if (kinds == Kinds::kAll && left > kRemovedRecords && !Transact([&] {
        return Put({mesh, RecordKind::kRemoved, -1, 0}, "");
      })) {
    return false;
  }
  const auto parameters = Parameters()
                              .Add(lease_->term())
                              .Add(mesh)
                              .Add(Number(range.first))
                              .Add(Number(range.last))
                              .Add(kRemovedRecords);
  if (!Write(kRemoveSome, parameters) || !Measure(mesh, range, &left)) return false;
  *done = left == 0;
  return true;
}

Records::Found PostgresRecords::Read(const Place& place, std::string* record) {
  Rows rows;
  const Parameters parameters =
      Parameters().Add(place.mesh).Add(Number(place.kind)).Add(place.number).Add(place.part);
  if (!Run(kRead, parameters, &rows)) return Found::kDamaged;
  if (rows.count() == 0) return Found::kNo;
  *record = rows.Bytes(0, 1);
  const auto seal = static_cast<std::uint64_t>(rows.Number(0, 0));
  return SealOf(*record, place) == seal ? Found::kYes : Found::kDamaged;
}

bool PostgresRecords::ListPlaces(std::int64_t mesh, std::vector<Place>* places) {
  Rows rows;
  if (!Run(kList, Parameters().Add(mesh), &rows)) return false;
  places->clear();
  for (int row = 0; row < rows.count(); ++row) {
    places->push_back({mesh, static_cast<RecordKind>(rows.Number(row, 0)), rows.Number(row, 1),
                       rows.Number(row, 2)});
  }
  return true;
}

std::uint64_t PostgresRecords::BytesOf(std::int64_t mesh) const {
  const auto it = bytes_.find(mesh);
  return it == bytes_.end() ? 0 : it->second;
}

}  // namespace stellate::server
