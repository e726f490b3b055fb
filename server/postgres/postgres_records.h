#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"
#include "server/base/clock.h"
#include "server/postgres/connection.h"
#include "server/postgres/database_lease.h"
#include "server/storage/records.h"

namespace stellate::server {

// Records in a database of PostgreSQL that this server holds by a lease. Each write is one
// statement that has the lease's term in it, and may be repeated: whether the database is away for
// a while, or breaks off before it has said that it is done, each record is there once. Where the
// database is away, calls wait for it.
class PostgresRecords final : public Records {
 public:
  struct Options {
    std::uint64_t max_bytes = 0;  // of all records; 0: no limit but the database's
    Clock::duration patience = std::chrono::hours(1);  // how long a call waits for the database
  };

  // Reads what there is of each mesh. kFailedPrecondition, and nothing is changed: the database
  // does not answer, or a record is damaged.
  static core::Expected<std::unique_ptr<PostgresRecords>> Open(const std::string& url,
                                                               std::unique_ptr<DatabaseLease> lease,
                                                               const Options& options);

  std::map<std::int64_t, StoredMesh> TakeMeshes() override { return std::move(meshes_); }
  bool Transact(const std::function<bool()>& action) override;
  bool Put(const Place& place, std::string_view record) override;
  bool Remove(const Place& place) override;
  std::int64_t NewMesh() override { return next_mesh_++; }
  void Abandon() override { Clear(); }
  bool RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) override;
  Found Read(const Place& place, std::string* record) override;
  bool ListPlaces(std::int64_t mesh, std::vector<Place>* places) override;
  std::uint64_t BytesOf(std::int64_t mesh) const override;
  Trouble trouble() const override { return trouble_; }
  void StopWaiting() override { stopping_ = true; }
  bool AreLost() const override { return lease_->IsLost(); }
  bool AreAway() const override { return !lease_->IsAnswered(); }

 private:
  PostgresRecords(std::string url, std::unique_ptr<DatabaseLease> lease, const Options& options)
      : url_(std::move(url)), options_(options), lease_(std::move(lease)) {}
  core::Status Load();
  bool Run(const char* sql, const Parameters& parameters, Rows* rows);
  Connection::Outcome TryRun(const char* sql, const Parameters& parameters, Rows* rows);
  bool Write(const char* sql, const Parameters& parameters);
  bool SendPut();
  bool Measure(std::int64_t mesh, KindRange kinds, std::int64_t* records);
  void Clear();
  void NoteAbsence(bool away);
  bool Fail(bool full, std::string message);
  void Rest() const;

  const std::string url_;
  const Options options_;
  const std::unique_ptr<DatabaseLease> lease_;
  std::unique_ptr<Connection> connection_;  // null: broken
  std::atomic<bool> stopping_{false};
  std::optional<TimePoint> away_since_;
  Trouble trouble_;

  std::map<std::int64_t, StoredMesh> meshes_;
  std::int64_t next_mesh_ = 1;
  std::map<std::int64_t, std::uint64_t> bytes_;  // by mesh
  std::uint64_t total_bytes_ = 0;

  // Put and not sent.
  struct {
    std::vector<std::int64_t> mesh, kind, number, part, seal;
    std::vector<std::string> bytes;
    std::size_t size = 0;
  } put_;
};

}  // namespace stellate::server
