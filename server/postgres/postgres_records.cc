#include "server/postgres/postgres_records.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/postgres/statements.h"

namespace stellate::server {
namespace {

using core::Message;

// Sent at once. What a transaction has beyond that goes in several statements, the last record in
// the last: a round is there once its own record is, and that is put after its answers.
constexpr std::size_t kSentBytes = std::size_t{16} << 20;
constexpr std::int64_t kRemovedRecords = 16;  // at once: of a megabyte at most each

std::int64_t Number(RecordKind kind) { return static_cast<std::int64_t>(kind); }

Records::Trouble AnothersMesh() {
  return {false, "another server has the mesh", Records::Trouble::Refusal::kNone};
}

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

bool PostgresRecords::Run(const char* sql, const Parameters& parameters, Rows* rows) {
  if (database_.Run(sql, parameters, rows)) return true;
  const auto& [full, message] = database_.trouble();
  trouble_ = {full, message, Trouble::Refusal::kNone};
  return false;
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
  if (!Run(statements::kRenew, parameters, &rows)) return false;
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
  if (!Run(statements::kAdopt, Parameters().Add(lease_->number()).AddBytes(name), &rows))
    return false;
  std::vector<std::int64_t> held, epochs;
  Fresh fresh;
  ListHeld(&held, &epochs);
  if (!Run(statements::kUnknown, Parameters().Add(lease_->number()).Add(held), &rows)) return false;
  {
    const std::lock_guard lock(mutex_);
    for (int row = 0; row < rows.count(); ++row) {
      const std::int64_t mesh = rows.Number(row, 0);
      fresh.meshes.push_back(mesh);
      epochs_[mesh] = rows.Number(row, 1);
      if (rows.Flag(row, 2)) (rows.Flag(row, 3) ? fresh.deleted : fresh.nameless).insert(mesh);
    }
  }
  if (!fresh.meshes.empty() && !Load(fresh, tidings)) {
    for (const std::int64_t mesh : fresh.meshes) Lose(mesh);  // the next Tend finds them again
    return false;
  }
  if (!name.empty()) return true;
  if (!Run(statements::kElsewhere, Parameters().Add(lease_->number()), &rows)) return false;
  bytes_.elsewhere = 0;
  for (int row = 0; row < rows.count(); ++row) {
    const auto bytes = static_cast<std::uint64_t>(rows.Number(row, 1));
    tidings->owners_bytes[std::string(rows.Bytes(row, 0))] = bytes;
    bytes_.elsewhere += bytes;
  }
  return true;
}

// What there is of each. One that is damaged is left as it is.
bool PostgresRecords::Load(const Fresh& fresh, Tidings* tidings) {
  const auto& ids = fresh.meshes;
  Rows rows;
  const auto answers = Number(RecordKind::kAnswers), history = Number(RecordKind::kHistoryPart);
  if (!Run(statements::kLoad, Parameters().Add(answers).Add(history).Add(ids), &rows)) return false;
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
  if (!Run(statements::kLoadSizes, Parameters().Add(ids), &rows)) return false;
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
    mesh.removed = mesh.removed || fresh.deleted.contains(id);
    if (mesh.start.empty() && !mesh.removed) {  // nobody has heard of it
      if (!Forget(id)) return false;
    } else if (fresh.nameless.contains(id) && !Name(id, mesh)) {
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
  if (stored.removed) return true;
  MeshRequest request;
  std::chrono::system_clock::time_point unused;
  if (!DecodeStart(stored.start, &request, &unused)) return true;
  Rows rows;
  return Run(statements::kName,
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
  if (!Run(statements::kLocate, Parameters().AddBytes(name), &rows)) return false;
  *found = {};
  if (rows.count() == 0) return true;
  *found = {true, rows.Number(0, 0), rows.Flag(0, 1), std::string(rows.Bytes(0, 2))};
  return true;
}

// Of one mesh.
bool PostgresRecords::Write(const char* sql, std::int64_t mesh, const Parameters& parameters) {
  Rows rows;
  if (!Run(sql, parameters, &rows)) return false;
  if (rows.count() == 1) return true;
  Lose(mesh);
  trouble_ = AnothersMesh();
  return false;
}

std::int64_t PostgresRecords::NewMesh() {
  Rows rows;
  return Run(statements::kNewMesh, {}, &rows) && rows.count() == 1 ? rows.Number(0, 0) : 0;
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
    if (!Run(statements::kBegin,
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
  if (max_bytes_ > 0 && all + put_.size > max_bytes_) {
    trouble_ = {
        true,
        Message("its records have ", all, " bytes of the ", max_bytes_, " of --max-journal-bytes"),
        Trouble::Refusal::kNone};
    return false;
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
  if (!Run(statements::kPut, parameters.AddBytes(put_.bytes), &rows)) return false;
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
  if (mine.size() == meshes.size()) return true;
  trouble_ = AnothersMesh();
  return false;
}

// Asks anew, so that what was repeated counts once.
bool PostgresRecords::Measure(std::int64_t mesh, KindRange kinds, std::int64_t* records) {
  Rows rows;
  const auto parameters = Parameters().Add(mesh).Add(Number(kinds.first)).Add(Number(kinds.last));
  if (!Run(statements::kMeasure, parameters, &rows)) return false;
  const auto bytes = static_cast<std::uint64_t>(rows.Number(0, 0));
  bytes_.total += bytes - std::exchange(bytes_.of[mesh], bytes);
  if (bytes == 0) bytes_.of.erase(mesh);
  *records = rows.Number(0, 1);
  return true;
}

bool PostgresRecords::Remove(const Place& place) {
  std::int64_t left = 0;
  return Write(statements::kRemove, place.mesh,
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
  if (!Run(statements::kForget, Parameters().Add(mesh).Add(EpochOf(mesh)), &rows)) return false;
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
  if (all && !Write(statements::kUnname, mesh, Parameters().Add(mesh).Add(EpochOf(mesh))))
    return false;
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
  if (!Write(statements::kRemoveSome, mesh, parameters) || !Measure(mesh, range, &left))
    return false;
  *done = left == 0;
  return !*done || !all || Forget(mesh);
}

Records::Found PostgresRecords::Read(const Place& place, std::string* record) {
  Rows rows;
  const Parameters parameters =
      Parameters().Add(place.mesh).Add(Number(place.kind)).Add(place.number).Add(place.part);
  if (!Run(statements::kRead, parameters, &rows)) return Found::kDamaged;
  if (rows.count() == 0) return Found::kNo;
  *record = rows.Bytes(0, 1);
  const auto seal = static_cast<std::uint64_t>(rows.Number(0, 0));
  return SealOf(*record, place) == seal ? Found::kYes : Found::kDamaged;
}

bool PostgresRecords::ListPlaces(std::int64_t mesh, std::vector<Place>* places) {
  Rows rows;
  if (!Run(statements::kList, Parameters().Add(mesh), &rows)) return false;
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
