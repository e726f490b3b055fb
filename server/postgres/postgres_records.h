#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/clock.h"
#include "server/postgres/patient_connection.h"
#include "server/postgres/server_lease.h"
#include "server/storage/records.h"

namespace stellate::server {

// Records in a database of PostgreSQL, which several servers share: each mesh is one server's at a
// time. Each write is one statement that has the epochs of its meshes in it, does nothing for those
// that have changed hands, and may be repeated: whether the database is away for a while, or breaks
// off before it has said that it is done, each record is there once. Where the database is away,
// calls wait for it.
class PostgresRecords final : public Records, public Sharing {
 public:
  struct Options {
    std::uint64_t max_bytes = 0;  // of all records; 0: no limit but the database's
    Clock::duration patience = std::chrono::hours(1);  // how long a call waits for the database
  };

  // Takes up the meshes that no server has, and reads what there is of each. kFailedPrecondition,
  // and no record is changed: the database does not answer, or a record is damaged.
  static core::Expected<std::unique_ptr<PostgresRecords>> Open(const std::string& url,
                                                               std::unique_ptr<ServerLease> lease,
                                                               const Options& options);

  std::map<std::int64_t, StoredMesh> TakeMeshes() override { return std::move(first_.meshes); }
  bool Transact(const std::function<bool()>& action) override;
  bool Put(const Place& place, std::string_view record) override;
  bool Remove(const Place& place) override;
  std::int64_t NewMesh() override;
  void Abandon() override { put_ = {}; }
  bool RemoveSome(std::int64_t mesh, Kinds kinds, bool* done) override;
  Found Read(const Place& place, std::string* record) override;
  bool ListPlaces(std::int64_t mesh, std::vector<Place>* places) override;
  std::uint64_t BytesOf(std::int64_t mesh) const override;
  Trouble trouble() const override { return trouble_; }
  void StopWaiting() override { database_.StopWaiting(); }
  std::int64_t EpochOf(std::int64_t mesh) const override;
  bool AreAway() const override { return !lease_->IsAnswered(); }
  Sharing* sharing() override { return this; }

  std::int64_t number() const override { return lease_->number(); }
  std::int64_t beat() const override { return lease_->beat(); }
  std::vector<Peer> Peers() const override { return lease_->Peers(); }
  const std::string& secret() const override { return lease_->secret(); }
  void Announce(const std::string& address) override { lease_->Announce(address); }
  bool IsTendingDue() const override { return lease_->IsLost() || lease_->AreOrphansThere(); }
  void LimitOwners(std::uint64_t limit) override { owner_meshes_ = limit; }
  bool Tend(const std::string& name, Tidings* tidings) override;
  bool Locate(const std::string& name, Whereabouts* found) override;

 private:
  PostgresRecords(std::string url, std::unique_ptr<ServerLease> lease, const Options& options)
      : max_bytes_(options.max_bytes),
        lease_(std::move(lease)),
        database_(std::move(url), options.patience) {}
  bool Run(const char* sql, const Parameters& parameters, Rows* rows);
  bool Write(const char* sql, std::int64_t mesh, const Parameters& parameters);
  bool Begin();
  bool SendPut();
  bool Measure(std::int64_t mesh, KindRange kinds, std::int64_t* records);
  bool Forget(std::int64_t mesh);
  void Lose(std::int64_t mesh);
  bool Renew();
  // Meshes that this server has, and does not know yet.
  struct Fresh {
    std::vector<std::int64_t> meshes;
    std::set<std::int64_t> nameless;
    std::set<std::int64_t> deleted;  // by a server that was gone before all was removed
  };
  bool Load(const Fresh& fresh, Tidings* tidings);
  bool Name(std::int64_t mesh, const StoredMesh& stored);
  void ListHeld(std::vector<std::int64_t>* meshes, std::vector<std::int64_t>* epochs) const;

  const std::uint64_t max_bytes_;
  const std::unique_ptr<ServerLease> lease_;
  PatientConnection database_;
  std::atomic<std::uint64_t> owner_meshes_{0};
  Trouble trouble_;
  Tidings first_;  // of the meshes that were there

  mutable std::mutex mutex_;
  std::map<std::int64_t, std::int64_t> epochs_;  // of the meshes that this server has

  struct {
    std::map<std::int64_t, std::uint64_t> of;  // each mesh that this server has
    std::uint64_t total = 0, elsewhere = 0;
  } bytes_;

  // Put and not sent.
  struct {
    std::vector<std::int64_t> mesh, kind, number, part, seal;
    std::vector<std::string> bytes;
    std::size_t size = 0;
    std::map<std::int64_t, std::string> starts;  // by mesh
    std::set<std::int64_t> ended;                // meshes
  } put_;
};

}  // namespace stellate::server
