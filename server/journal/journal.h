#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"
#include "server/base/refusal.h"
#include "server/journal/shared_journal.h"
#include "server/session/session.h"
#include "server/session/session_journal.h"

namespace stellate::server {

struct JournalOptions {
  std::string directory;          // made if it is not there; empty: the records are elsewhere
  std::uint64_t max_bytes = 0;    // of the journal's file; 0: what the disk holds
  std::uint64_t owner_bytes = 0;  // of the records of an owner's meshes, where owners have names;
                                  // 0: no limit
};

// What a mesh records before it gets anywhere: its specification without seeds, and some answers.
inline constexpr std::uint64_t kFirstRecordBytes = std::uint64_t{1} << 16;

// Half of the space that a journal may use: its limit, or its size and the free space of the disk.
std::uint64_t DefaultOwnerBytes(const std::string& directory, std::uint64_t max_bytes);

// The record of all meshes of a server, in one SQLite file of its data directory, or elsewhere. It
// has each mesh's specification, the answers of each round, and its end; once the mesh has ended,
// the mesh itself replaces the answers. Meshes write from their own threads, one transaction a
// round, synced to the disk before the call returns.
//
//   auto journal = Journal::Open(options);
//   for (SessionOptions& mesh : (*journal)->TakeMeshes()) store.Restore(std::move(mesh));
//   options.ports.journal = (*journal)->NewMesh();   // for a new mesh
class Journal {
 public:
  // Opens the record of an earlier server, or creates one. kFailedPrecondition, without changing a
  // byte: the file is not a journal, has another version, is damaged (every record is read, and
  // must exist), or is open in another server.
  static core::Expected<std::unique_ptr<Journal>> Open(const JournalOptions& options);
  // The same, of records that are elsewhere and open. kFailedPrecondition: they contradict each
  // other.
  static core::Expected<std::unique_ptr<Journal>> Over(std::unique_ptr<Records> records,
                                                       const JournalOptions& options);
  // Running meshes keep their part of it open.
  ~Journal();

  // Returns the meshes that it had when it was opened, oldest first: the recorded part of
  // SessionOptions, and their journal.
  std::vector<SessionOptions> TakeMeshes() { return std::exchange(meshes_, {}); }

  // For a new mesh.
  std::shared_ptr<SessionJournal> NewMesh();
  // Returns why the first `bytes` of a new mesh of `owner` cannot be recorded, and what to do;
  // nothing if they can. Any thread; does not wait.
  std::optional<Refused> RefuseNewMesh(const std::string& owner, std::uint64_t bytes) const;

  // Why no new mesh can be recorded, whatever its owner; empty: it can. Any thread; does not wait.
  std::string WhyNoNewMeshes() const;

  // Where the records are away, writes of meshes fail from now on, in place of waiting. Any thread.
  void StopWaiting() { shared_->StopWaiting(); }
  // What the servers have in common that share the records; null: there is one alone. Any thread.
  Sharing* sharing() const { return shared_->sharing(); }
  // Of records that are shared: meshes that this server has from now on, as from TakeMeshes; those
  // whose servers are gone, or the one of that name. Waits for the records.
  std::vector<SessionOptions> Tend(const std::string& name = "");
  // Where the mesh of that name is. Nothing: the records cannot say, as they are away and the
  // server stops. Waits for the records.
  std::optional<Whereabouts> Locate(const std::string& name);
  // What keeps the records does not answer, and meshes wait for it. Any thread.
  bool IsAway() const { return shared_->AreAway(); }

  // Bytes of the records of an owner's meshes; the file is larger by about a twentieth.
  std::uint64_t OwnerBytes(const std::string& owner) const { return shared_->OwnerBytes(owner); }

 private:
  Journal(std::shared_ptr<SharedJournal> shared, JournalOptions options);
  static core::Expected<std::unique_ptr<Journal>> Begin(std::unique_ptr<DataDirectory> directory,
                                                        std::unique_ptr<Records> records,
                                                        const JournalOptions& options);
  bool Take(std::int64_t id, const StoredMesh& stored);

  const std::shared_ptr<SharedJournal> shared_;
  const JournalOptions options_;
  std::vector<SessionOptions> meshes_;
};

}  // namespace stellate::server
