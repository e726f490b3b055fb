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

// The mesh's row is locked, so that a takeover waits for what is being written, and a write that
// came after it finds no row and does nothing. $1: the mesh; $2: its epoch, as this server has it.
#define STELLATE_MINE \
  "WITH mine AS (SELECT id FROM stellate.meshes WHERE id = $1 AND epoch = $2 FOR NO KEY UPDATE), "

// Of several meshes. $1, $2: them and their epochs; $3: what their records will have in bytes;
// $4: whether they end by this; $5, $6: their names and owners, where they are begun.
constexpr char kPut[] =
    "WITH mine AS (SELECT m.id, e.bytes, e.ended, e.name, e.owner FROM stellate.meshes AS m, "
    "unnest($1, $2, $3, $4, $5, $6) AS e (id, epoch, bytes, ended, name, owner) "
    "WHERE m.id = e.id AND m.epoch = e.epoch FOR NO KEY UPDATE OF m), "
    "put AS (INSERT INTO stellate.records AS r (mesh, kind, number, part, seal, bytes) "
    "SELECT p.mesh, p.kind, p.number, p.part, p.seal, p.bytes FROM mine, "
    "unnest($7, $8, $9, $10, $11, $12) AS p (mesh, kind, number, part, seal, bytes) "
    "WHERE p.mesh = mine.id "
    "ON CONFLICT (mesh, kind, number, part) DO UPDATE SET seal = excluded.seal, "
    "bytes = excluded.bytes WHERE r.seal <> excluded.seal), "
    "note AS (UPDATE stellate.meshes AS m SET bytes = mine.bytes, "
    "ended = m.ended OR mine.ended > 0, name = coalesce(nullif(mine.name, ''), m.name), "
    "owner = CASE WHEN mine.name = '' THEN m.owner ELSE mine.owner END "
    "FROM mine WHERE m.id = mine.id) "
    "SELECT id FROM mine";
constexpr char kRemove[] = STELLATE_MINE
    "gone AS (DELETE FROM stellate.records AS r USING mine WHERE r.mesh = mine.id AND kind = $3 "
    "AND number = $4 AND part = $5) "
    "SELECT id FROM mine";
// The last rounds first: what is left has no gap. A mesh's mark is the last to go.
constexpr char kRemoveSome[] = STELLATE_MINE
    "gone AS (DELETE FROM stellate.records AS r USING mine, "
    "(SELECT mesh, kind, number, part FROM stellate.records WHERE mesh = $1 AND kind BETWEEN $3 "
    "AND $4 ORDER BY number DESC, kind DESC, part DESC LIMIT $5) AS s "
    "WHERE (r.mesh, r.kind, r.number, r.part) = (s.mesh, s.kind, s.number, s.part)) "
    "SELECT id FROM mine";
// The name is free, and nobody finds the mesh any more.
constexpr char kUnname[] =
    "UPDATE stellate.meshes SET name = NULL, ended = true WHERE id = $1 AND epoch = $2 "
    "RETURNING id";
constexpr char kForget[] = "DELETE FROM stellate.meshes WHERE id = $1 AND epoch = $2 RETURNING id";
constexpr char kBegin[] = "SELECT stellate.begin_mesh($1, $2, $3, $4, $5)";
constexpr char kNewMesh[] = "SELECT nextval('stellate.mesh_ids')";

// A share of the meshes whose servers are gone, or that of the name $2. What is locked is being
// written, or taken up, by another. Not by a server that is gone itself.
constexpr char kAdopt[] =
    "WITH orphan AS (SELECT m.id FROM stellate.meshes AS m, stellate.servers AS me "
    "WHERE me.id = $1 AND ($2 = '' OR m.name = $2) AND "
    "NOT EXISTS (SELECT FROM stellate.servers AS s WHERE s.id = m.server) "
    "ORDER BY m.id LIMIT (SELECT greatest(2, (SELECT count(*) FROM stellate.meshes AS o WHERE "
    "NOT EXISTS (SELECT FROM stellate.servers AS s WHERE s.id = o.server)) "
    "/ (SELECT count(*) FROM stellate.servers) + 1)) FOR UPDATE OF m SKIP LOCKED) "
    "UPDATE stellate.meshes AS m SET server = $1, epoch = m.epoch + 1 FROM orphan "
    "WHERE m.id = orphan.id RETURNING m.id";
// What this server has, and does not know of: also where it did not hear that it had taken it up.
constexpr char kUnknown[] =
    "SELECT id, epoch FROM stellate.meshes WHERE server = $1 AND NOT id = ANY ($2)";
// This server was away, and has another row: the meshes that nobody took up meanwhile are its own,
// as they are.
constexpr char kRenew[] =
    "WITH me AS (INSERT INTO stellate.servers (address, beats) VALUES ($1, 0) RETURNING id), "
    "back AS (UPDATE stellate.meshes AS m SET server = me.id FROM me, "
    "unnest($2, $3) AS e (id, epoch) WHERE m.id = e.id AND m.epoch = e.epoch RETURNING m.id) "
    "SELECT me.id, back.id FROM me LEFT JOIN back ON true";
constexpr char kName[] =
    "UPDATE stellate.meshes SET name = $2, owner = $3, ended = $4 > 0, bytes = $5 "
    "WHERE id = $1 AND name IS NULL AND NOT EXISTS (SELECT FROM stellate.meshes WHERE name = $2) "
    "RETURNING id";
constexpr char kLocate[] =
    "SELECT m.server, s.id IS NULL, coalesce(s.address, '') FROM stellate.meshes AS m "
    "LEFT JOIN stellate.servers AS s ON s.id = m.server WHERE m.name = $1";
constexpr char kElsewhere[] =
    "SELECT owner, sum(bytes)::int8 FROM stellate.meshes WHERE server <> $1 GROUP BY owner";
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
    "WHERE mesh = ANY ($3) AND kind NOT IN ($1, $2) ORDER BY mesh, kind, number, part";
constexpr char kLoadSizes[] =
    "SELECT mesh, kind::int8, sum(octet_length(bytes))::int8 FROM stellate.records "
    "WHERE mesh = ANY ($1) GROUP BY mesh, kind";
#undef STELLATE_MINE

std::int64_t Number(RecordKind kind) { return static_cast<std::int64_t>(kind); }

}  // namespace

core::Expected<std::unique_ptr<PostgresRecords>> PostgresRecords::Open(
    const std::string& url, std::unique_ptr<ServerLease> lease, const Options& options) {
  std::unique_ptr<PostgresRecords> records(new PostgresRecords(url, std::move(lease), options));
  Tidings& first = records->first_;
  if (!records->Tend("", &first)) {
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        Message("the records in the database of --database cannot be read: ",
                                records->trouble_.message));
  }
  if (!first.troubles.empty()) {
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        Message("the records in the database of --database cannot be read: ",
                                first.troubles.front()));
  }
  return records;
}

std::int64_t PostgresRecords::EpochOf(std::int64_t mesh) const {
  const std::lock_guard lock(mutex_);
  const auto it = epochs_.find(mesh);
  return it == epochs_.end() ? 0 : it->second;
}

void PostgresRecords::ListHeld(std::vector<std::int64_t>* meshes,
                               std::vector<std::int64_t>* epochs) const {
  const std::lock_guard lock(mutex_);
  for (const auto& [mesh, epoch] : epochs_) {
    meshes->push_back(mesh);
    epochs->push_back(epoch);
  }
}

// Another server has it, or it is gone.
void PostgresRecords::Lose(std::int64_t mesh) {
  if (const auto it = bytes_.of.find(mesh); it != bytes_.of.end()) {
    bytes_.total -= it->second;
    bytes_.of.erase(it);
  }
  const std::lock_guard lock(mutex_);
  epochs_.erase(mesh);
}

bool PostgresRecords::Renew() {
  std::vector<std::int64_t> meshes, epochs;
  ListHeld(&meshes, &epochs);
  Rows rows;
  const std::string address = lease_->address();
  const auto parameters = Parameters().Add(std::string_view(address)).Add(meshes).Add(epochs);
  if (!Run(kRenew, parameters, &rows)) return false;
  std::set<std::int64_t> kept;
  for (int row = 0; row < rows.count(); ++row) kept.insert(rows.Number(row, 1));
  std::size_t lost = 0;
  for (const std::int64_t mesh : meshes) {
    if (kept.contains(mesh)) continue;
    Lose(mesh);
    ++lost;
  }
  Log(LogLevel::kWarning, {}, "this server was silent for too long, and is back",
      LogFields().Add("meshes_kept", meshes.size() - lost).Add("meshes_lost", lost));
  lease_->Renew(rows.Number(0, 0));
  return true;
}

bool PostgresRecords::Tend(const std::string& name, Tidings* tidings) {
  if (lease_->IsLost() && !Renew()) return false;
  Rows rows;
  if (!Run(kAdopt, Parameters().Add(lease_->number()).AddBytes(name), &rows)) return false;
  std::vector<std::int64_t> held, epochs, fresh;
  ListHeld(&held, &epochs);
  if (!Run(kUnknown, Parameters().Add(lease_->number()).Add(held), &rows)) return false;
  {
    const std::lock_guard lock(mutex_);
    for (int row = 0; row < rows.count(); ++row) {
      fresh.push_back(rows.Number(row, 0));
      epochs_[fresh.back()] = rows.Number(row, 1);
    }
  }
  if (!fresh.empty() && !Load(fresh, tidings)) {
    for (const std::int64_t mesh : fresh) Lose(mesh);  // the next Tend finds them again
    return false;
  }
  if (!name.empty()) return true;
  if (!Run(kElsewhere, Parameters().Add(lease_->number()), &rows)) return false;
  bytes_.elsewhere = 0;
  for (int row = 0; row < rows.count(); ++row) {
    const auto bytes = static_cast<std::uint64_t>(rows.Number(row, 1));
    tidings->owners_bytes[std::string(rows.Bytes(row, 0))] = bytes;
    bytes_.elsewhere += bytes;
  }
  return true;
}

// What there is of each. One that is damaged is left as it is.
bool PostgresRecords::Load(const std::vector<std::int64_t>& ids, Tidings* tidings) {
  Rows rows;
  const auto answers = Number(RecordKind::kAnswers), history = Number(RecordKind::kHistoryPart);
  if (!Run(kLoad, Parameters().Add(answers).Add(history).Add(ids), &rows)) return false;
  std::map<std::int64_t, StoredMesh> meshes;
  for (const std::int64_t id : ids) meshes[id];
  std::set<std::int64_t> damaged;
  for (int row = 0; row < rows.count(); ++row) {
    const Place place{rows.Number(row, 0), static_cast<RecordKind>(rows.Number(row, 1)),
                      rows.Number(row, 2), rows.Number(row, 3)};
    const std::string_view record = rows.Bytes(row, 5);
    if (SealOf(record, place) == static_cast<std::uint64_t>(rows.Number(row, 4)) &&
        meshes[place.mesh].Note(place, record)) {
      continue;
    }
    if (!damaged.insert(place.mesh).second) continue;
    tidings->troubles.push_back(Message(
        "one of mesh ", place.mesh, ", of kind ", Number(place.kind), " and number ", place.number,
        ", is damaged; all were left as they are: restore the database, or give the mesh up by "
        "DELETE FROM stellate.meshes WHERE id = ",
        place.mesh, " and DELETE FROM stellate.records WHERE mesh = ", place.mesh));
  }
  if (!Run(kLoadSizes, Parameters().Add(ids), &rows)) return false;
  for (int row = 0; row < rows.count(); ++row) {
    const Place place{rows.Number(row, 0), static_cast<RecordKind>(rows.Number(row, 1)), 0, 0};
    const auto size = static_cast<std::uint64_t>(rows.Number(row, 2));
    StoredMesh& mesh = meshes[place.mesh];
    mesh.bytes += size;
    bytes_.of[place.mesh] += size;
    bytes_.total += size;
    if (Number(place.kind) == answers || Number(place.kind) == history) mesh.Note(place, "");
  }
  for (auto& [id, mesh] : meshes) {
    if (damaged.contains(id)) continue;
    if (mesh.start.empty() && !mesh.removed) {  // nobody has heard of it
      if (!Forget(id)) return false;
    } else if (!Name(id, mesh)) {
      return false;
    } else {
      tidings->meshes.emplace(id, std::move(mesh));
    }
  }
  return true;
}

// Of a mesh that a server recorded which had the database for itself: its row lacks what others
// find it by.
bool PostgresRecords::Name(std::int64_t mesh, const StoredMesh& stored) {
  if (EpochOf(mesh) != 1 || stored.removed) return true;
  MeshRequest request;
  std::chrono::system_clock::time_point unused;
  if (!DecodeStart(stored.start, &request, &unused)) return true;
  Rows rows;
  return Run(kName,
             Parameters()
                 .Add(mesh)
                 .AddBytes(request.name)
                 .AddBytes(request.owner)
                 .Add(std::int64_t{stored.end.empty() ? 0 : 1})
                 .Add(static_cast<std::int64_t>(stored.bytes)),
             &rows);
}

bool PostgresRecords::Locate(const std::string& name, Whereabouts* found) {
  Rows rows;
  if (!Run(kLocate, Parameters().AddBytes(name), &rows)) return false;
  *found = {};
  if (rows.count() == 0) return true;
  *found = {true, rows.Number(0, 0), rows.Flag(0, 1), std::string(rows.Bytes(0, 2))};
  return true;
}

bool PostgresRecords::Fail(bool full, std::string message) {
  trouble_ = {full, std::move(message), Trouble::Refusal::kNone};
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

// Of one mesh.
bool PostgresRecords::Write(const char* sql, std::int64_t mesh, const Parameters& parameters) {
  Rows rows;
  if (!Run(sql, parameters, &rows)) return false;
  if (rows.count() == 1) return true;
  Lose(mesh);
  return Fail(false, "another server has the mesh");
}

std::int64_t PostgresRecords::NewMesh() {
  Rows rows;
  return Run(kNewMesh, {}, &rows) && rows.count() == 1 ? rows.Number(0, 0) : 0;
}

bool PostgresRecords::Transact(const std::function<bool()>& action) {
  put_ = {};
  return action() && SendPut();
}

bool PostgresRecords::Put(const Place& place, std::string_view record) {
  if (place.mesh == 0) return false;  // NewMesh has failed
  if (place.kind == RecordKind::kStart) put_.starts[place.mesh] = record;
  if (place.kind == RecordKind::kEnd) put_.ended.insert(place.mesh);
  put_.mesh.push_back(place.mesh);
  put_.kind.push_back(Number(place.kind));
  put_.number.push_back(place.number);
  put_.part.push_back(place.part);
  put_.seal.push_back(static_cast<std::int64_t>(SealOf(record, place)));
  put_.bytes.emplace_back(record);
  put_.size += record.size();
  return put_.size < kSentBytes || SendPut();
}

namespace {

// What others find a mesh by.
MeshRequest RequestIn(const std::string& start) {
  MeshRequest request;
  std::chrono::system_clock::time_point unused;
  if (!start.empty()) DecodeStart(start, &request, &unused);
  return request;
}

}  // namespace

// The rows of meshes that are put for the first time.
bool PostgresRecords::Begin() {
  const std::set<std::int64_t> meshes(put_.mesh.begin(), put_.mesh.end());
  for (const std::int64_t mesh : meshes) {
    if (EpochOf(mesh) != 0) continue;
    const MeshRequest request = RequestIn(put_.starts[mesh]);
    const auto limit = static_cast<std::int64_t>(owner_meshes_.load());
    Rows rows;
    if (!Run(kBegin,
             Parameters()
                 .Add(mesh)
                 .AddBytes(request.name)
                 .AddBytes(request.owner)
                 .Add(lease_->number())
                 .Add(limit),
             &rows)) {
      return false;
    }
    const std::int64_t refusal = rows.Number(0, 0);
    if (refusal == 2) {
      trouble_ = {true,
                  Message("you run ", limit,
                          " meshes, the most that the servers allow each owner: wait for one to "
                          "end, cancel one, or raise --owner-meshes"),
                  Trouble::Refusal::kTooMany};
      return false;
    }
    if (refusal == 1) {
      trouble_ = {false, "another mesh has the name", Trouble::Refusal::kTaken};
      return false;
    }
    const std::lock_guard lock(mutex_);
    epochs_[mesh] = 1;
  }
  return true;
}

bool PostgresRecords::SendPut() {
  if (put_.mesh.empty()) return true;
  const std::uint64_t all = bytes_.total + bytes_.elsewhere;
  if (options_.max_bytes > 0 && all + put_.size > options_.max_bytes) {
    return Fail(true, Message("its records have ", all, " bytes of the ", options_.max_bytes,
                              " of --max-journal-bytes"));
  }
  if (!Begin()) return false;
  std::map<std::int64_t, std::uint64_t> bytes;  // by mesh
  for (std::size_t i = 0; i < put_.mesh.size(); ++i) bytes[put_.mesh[i]] += put_.bytes[i].size();
  std::vector<std::int64_t> meshes, epochs, sums, ended;
  std::vector<std::string> names, owners;
  for (const auto& [mesh, more] : bytes) {
    const MeshRequest request = RequestIn(put_.starts[mesh]);
    meshes.push_back(mesh);
    epochs.push_back(EpochOf(mesh));
    sums.push_back(static_cast<std::int64_t>(BytesOf(mesh) + more));
    ended.push_back(put_.ended.contains(mesh) ? 1 : 0);
    names.push_back(request.name);
    owners.push_back(request.owner);
  }
  Parameters parameters;
  parameters.Add(meshes).Add(epochs).Add(sums).Add(ended).AddBytes(names).AddBytes(owners);
  parameters.Add(put_.mesh).Add(put_.kind).Add(put_.number).Add(put_.part).Add(put_.seal);
  Rows rows;
  if (!Run(kPut, parameters.AddBytes(put_.bytes), &rows)) return false;
  std::set<std::int64_t> mine;
  for (int row = 0; row < rows.count(); ++row) mine.insert(rows.Number(row, 0));
  for (const std::int64_t mesh : meshes) {
    if (mine.contains(mesh)) {
      bytes_.of[mesh] += bytes[mesh];
      bytes_.total += bytes[mesh];
    } else {
      Lose(mesh);
    }
  }
  put_ = {};
  return mine.size() == meshes.size() || Fail(false, "another server has the mesh");
}

// Asks anew, so that what was repeated counts once.
bool PostgresRecords::Measure(std::int64_t mesh, KindRange kinds, std::int64_t* records) {
  Rows rows;
  const auto parameters = Parameters().Add(mesh).Add(Number(kinds.first)).Add(Number(kinds.last));
  if (!Run(kMeasure, parameters, &rows)) return false;
  const auto bytes = static_cast<std::uint64_t>(rows.Number(0, 0));
  bytes_.total += bytes - std::exchange(bytes_.of[mesh], bytes);
  if (bytes == 0) bytes_.of.erase(mesh);
  *records = rows.Number(0, 1);
  return true;
}

bool PostgresRecords::Remove(const Place& place) {
  std::int64_t left = 0;
  return Write(kRemove, place.mesh,
               Parameters()
                   .Add(place.mesh)
                   .Add(EpochOf(place.mesh))
                   .Add(Number(place.kind))
                   .Add(place.number)
                   .Add(place.part)) &&
         Measure(place.mesh, {place.kind, place.kind}, &left);
}

// Its row, the last of a mesh.
bool PostgresRecords::Forget(std::int64_t mesh) {
  Rows rows;
  if (!Run(kForget, Parameters().Add(mesh).Add(EpochOf(mesh)), &rows)) return false;
  Lose(mesh);
  return true;
}

bool PostgresRecords::RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) {
  const KindRange range = RangeOf(kinds);
  const bool all = kinds == Kinds::kAll;
  std::int64_t left = 0;
  if (!Measure(mesh, range, &left)) return false;
  *done = left == 0;
  if (*done) return !all || Forget(mesh);
  if (all && !Write(kUnname, mesh, Parameters().Add(mesh).Add(EpochOf(mesh)))) return false;
  if (all && left > kRemovedRecords && !Transact([&] {
        return Put({mesh, RecordKind::kRemoved, -1, 0}, "");
      })) {
    return false;
  }
  const auto parameters = Parameters()
                              .Add(mesh)
                              .Add(EpochOf(mesh))
                              .Add(Number(range.first))
                              .Add(Number(range.last))
                              .Add(kRemovedRecords);
  if (!Write(kRemoveSome, mesh, parameters) || !Measure(mesh, range, &left)) return false;
  *done = left == 0;
  return !*done || !all || Forget(mesh);
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
  const auto it = bytes_.of.find(mesh);
  return it == bytes_.of.end() ? 0 : it->second;
}

}  // namespace stellate::server
