#include "server/storage/journal_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr int kLogPages = 1000;  // 4 MB

constexpr std::int64_t kRemovedBytes = std::int64_t{8} << 20;  // at once
constexpr int kPagesGivenBack = 512;  // at once: each may be another's, moved

constexpr off_t kReserveBytes = off_t{16} << 20;

}  // namespace

bool JournalFile::Transact(const std::function<bool()>& action) {
  pending_ = state_;
  pending_bytes_.clear();
  ++pending_.commits;
  if (!database_->Execute("BEGIN IMMEDIATE") || !action() || !PutState() ||
      !database_->Execute("COMMIT")) {
    return false;
  }
  state_ = pending_;
  for (const auto& [mesh, bytes] : pending_bytes_) {
    if ((bytes_[mesh] += static_cast<std::uint64_t>(bytes)) == 0) bytes_.erase(mesh);
  }
  // It may lag behind what is recorded.
  if (mark_ != nullptr) mark_->Write(mark_state());
  return true;
}

void JournalFile::Abandon() { database_->Abandon(); }

bool JournalFile::Put(const Place& place, std::string_view record) {
  const std::uint64_t seal = SealOf(record, place);
  Statement insert(*database_,
                   "INSERT INTO records (mesh, kind, number, part, seal, bytes) "
                   "VALUES (?, ?, ?, ?, ?, ?)");
  insert.Bind(0, place.mesh).Bind(1, static_cast<std::int64_t>(place.kind));
  insert.Bind(2, place.number).Bind(3, place.part).Bind(4, static_cast<std::int64_t>(seal));
  if (!insert.Bind(5, record).Run()) return false;
  ++pending_.records;
  pending_.sum += seal;
  pending_bytes_[place.mesh] += static_cast<std::int64_t>(record.size());
  return true;
}

bool JournalFile::PutState() {
  const std::string record = EncodeState(pending_);
  Statement update(*database_, "UPDATE state SET seal = ?, bytes = ?");
  return update.Bind(0, static_cast<std::int64_t>(SealOf(record, Place{}))).Bind(1, record).Run();
}

JournalFile::Found JournalFile::Read(const Place& place, std::string* record) {
  Statement row(*database_,
                "SELECT seal, bytes FROM records WHERE mesh = ? AND kind = ? AND number = ? AND "
                "part = ?");
  row.Bind(0, place.mesh).Bind(1, static_cast<std::int64_t>(place.kind));
  row.Bind(2, place.number).Bind(3, place.part);
  if (!row.Next()) return row.failed() ? Found::kDamaged : Found::kNo;
  *record = row.Bytes(1);
  const auto seal = static_cast<std::uint64_t>(row.Number(0));
  return SealOf(*record, place) == seal ? Found::kYes : Found::kDamaged;
}

bool JournalFile::ListPlaces(std::int64_t mesh, std::vector<Place>* places) {
  Statement rows(*database_,
                 "SELECT kind, number, part FROM records WHERE mesh = ? ORDER BY kind, number, "
                 "part");
  rows.Bind(0, mesh);
  places->clear();
  while (rows.Next()) {
    places->push_back(
        {mesh, static_cast<RecordKind>(rows.Number(0)), rows.Number(1), rows.Number(2)});
  }
  return !rows.failed();
}

std::uint64_t JournalFile::BytesOf(std::int64_t mesh) const {
  const auto it = bytes_.find(mesh);
  return it == bytes_.end() ? 0 : it->second;
}

void JournalFile::Limit(std::uint64_t max_bytes) {
  if (max_bytes == 0) return;
  Statement size(*database_, "PRAGMA page_size");
  const std::uint64_t page = size.Next() ? static_cast<std::uint64_t>(size.Number(0)) : 4096;
  database_->Execute(
      Message("PRAGMA max_page_count=", std::max<std::uint64_t>(max_bytes / page, 1)).c_str());
}

// As much as the disk gives.
void JournalFile::Reserve(const std::string& path) {
  reserve_ = path;
  const int reserve = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  if (reserve < 0) return;
  if (posix_fallocate(reserve, 0, kReserveBytes) != 0) unlink(path.c_str());
  close(reserve);
}

// To remove is to write first: on a full disk the log has no room for it but what was reserved.
template <typename Action>
bool JournalFile::WithReserve(Action action) {
  if (action()) return true;
  if (!database_->IsFull()) return false;
  Abandon();
  unlink(reserve_.c_str());
  return action();
}

bool JournalFile::RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) {
  return WithReserve([&] { return RemovePiece(mesh, kinds, done); });
}

// The last rounds first: what is left has no gap.
bool JournalFile::RemovePiece(std::int64_t mesh, Kinds kinds, bool* done) {
  const auto [first, last] = RangeOf(kinds);
  std::vector<std::int64_t> ids;
  std::int64_t bytes = 0;
  std::uint64_t sum = 0;
  {
    Statement rows(*database_,
                   "SELECT id, seal, length(bytes) FROM records WHERE mesh = ? AND kind "
                   "BETWEEN ? AND ? ORDER BY number DESC, kind DESC, part DESC");
    rows.Bind(0, mesh).Bind(1, static_cast<std::int64_t>(first));
    rows.Bind(2, static_cast<std::int64_t>(last));
    *done = true;
    while (rows.Next()) {
      *done = bytes < kRemovedBytes;
      if (!*done) break;
      ids.push_back(rows.Number(0));
      sum += static_cast<std::uint64_t>(rows.Number(1));
      bytes += rows.Number(2);
    }
    if (rows.failed()) return false;
  }
  if (ids.empty()) return true;
  const Place mark{mesh, RecordKind::kRemoved, -1, 0};
  std::string unused;
  const bool unmarked = kinds == Kinds::kAll && !*done && Read(mark, &unused) == Found::kNo;
  return Transact([&] {
    for (const std::int64_t id : ids) {
      if (!Statement(*database_, "DELETE FROM records WHERE id = ?").Bind(0, id).Run()) {
        return false;
      }
    }
    pending_.records -= ids.size();
    pending_.sum -= sum;
    pending_bytes_[mesh] -= bytes;
    // The mark may take the room of what goes with it.
    return !unmarked || Put(mark, "");
  });
}

bool JournalFile::Remove(const Place& place) {
  std::int64_t id = 0;
  {
    Statement row(*database_,
                  "SELECT id, seal, length(bytes) FROM records WHERE mesh = ? AND kind = ? AND "
                  "number = ? AND part = ?");
    row.Bind(0, place.mesh).Bind(1, static_cast<std::int64_t>(place.kind));
    row.Bind(2, place.number).Bind(3, place.part);
    if (!row.Next()) return !row.failed();
    id = row.Number(0);
    --pending_.records;
    pending_.sum -= static_cast<std::uint64_t>(row.Number(1));
    pending_bytes_[place.mesh] -= row.Number(2);
  }
  return Statement(*database_, "DELETE FROM records WHERE id = ?").Bind(0, id).Run();
}

bool JournalFile::GiveBackSome(bool* done) {
  const bool given = WithReserve([&] {
    *done = !HasSpaceToGiveBack();
    if (*done) return database_->Execute("PRAGMA wal_checkpoint(TRUNCATE)");
    return database_->Execute(Message("PRAGMA incremental_vacuum(", kPagesGivenBack, ")").c_str());
  });
  if (given && *done && !reserve_.empty() && access(reserve_.c_str(), F_OK) != 0) {
    Reserve(reserve_);
  }
  return given;
}

bool JournalFile::HasSpaceToGiveBack() {
  Statement pages(*database_, "PRAGMA freelist_count");
  return pages.Next() && pages.Number(0) > 0;
}

bool JournalFile::IsLogLong() const { return database_->log_pages() >= kLogPages; }

}  // namespace stellate::server
