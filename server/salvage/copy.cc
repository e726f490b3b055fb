#include "server/salvage/copy.h"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "server/storage/data_directory.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using core::Message;
using core::Status;

constexpr std::size_t kAtOnce = std::size_t{8} << 20;  // bytes of a transaction

Status CannotCopy(std::string message) {
  return {core::StatusCode::kFailedPrecondition, std::move(message)};
}

// The records of one side, open; and, of a directory, its lock.
struct Side {
  std::unique_ptr<DataDirectory> directory;  // outlives the records
  std::unique_ptr<Records> records;
};

// A URL, or a file that holds one.
bool IsDatabase(const std::string& setting) {
  std::error_code error;
  return setting.find("://") != std::string::npos || fs::is_regular_file(setting, error);
}

core::Expected<Side> OpenSide(const std::string& setting, bool may_be_new,
                              const OpenRecordsOf& open_database) {
  Side side;
  if (IsDatabase(setting)) {
    auto opened = open_database(setting);
    if (!opened) return tl::unexpected(std::move(opened.error()));
    side.records = std::move(*opened);
    return side;
  }
  std::error_code error;
  if (!may_be_new && !fs::exists(setting, error)) {
    return tl::unexpected(CannotCopy(Message(
        setting, " is not there: name a data directory, a database's URL, or a file that has it")));
  }
  auto directory = DataDirectory::Open(setting);
  if (!directory) return tl::unexpected(std::move(directory.error()));
  side.directory = std::move(*directory);
  auto opened = may_be_new ? side.directory->TakeJournal() : side.directory->OpenJournal();
  if (!opened) return tl::unexpected(std::move(opened.error()));
  side.records = std::move(*opened);
  return side;
}

class Copy {
 public:
  Copy(Records* from, Records* to) : from_(*from), to_(*to) {}

  core::Expected<std::string> Run();

 private:
  Status RemoveHalves();
  Status CopyMesh(std::int64_t mesh);
  bool PutAll(std::int64_t mesh, std::int64_t copy, const std::vector<Place>& places);
  Status CompareMesh(std::int64_t mesh, std::int64_t copy, const std::vector<Place>& places);
  Status ReadOf(Records* records, const char* side, const Place& place, std::string* record);
  Status Unreadable(const char* side, Records* records);

  Records& from_;
  Records& to_;
  std::map<std::string, std::int64_t> there_;  // in `to`, by name
  Status trouble_ = Status::Ok();              // of `from`, within a transaction of `to`
  std::uint64_t records_ = 0, bytes_ = 0;
};

std::string NameIn(const StoredMesh& stored) {
  MeshRequest request;
  std::chrono::system_clock::time_point unused;
  return DecodeStart(stored.start, &request, &unused) ? request.name : "";
}

Place Mark(std::int64_t mesh) { return {mesh, RecordKind::kRemoved, -1, 0}; }

Status Copy::Unreadable(const char* side, Records* records) {
  return CannotCopy(Message("the records ", side, " cannot be read: ", records->trouble().message));
}

Status Copy::ReadOf(Records* records, const char* side, const Place& place, std::string* record) {
  if (records->Read(place, record) == Records::Found::kYes) return Status::Ok();
  return CannotCopy(Message("a record ", side, " cannot be read: of mesh ", place.mesh, ", kind ",
                            static_cast<std::int64_t>(place.kind), ", number ", place.number,
                            ", part ", place.part));
}

// What a copy that was broken off, or a deletion, has left.
Status Copy::RemoveHalves() {
  for (const auto& [id, stored] : to_.TakeMeshes()) {
    if (!stored.removed) {
      there_.emplace(NameIn(stored), id);
      continue;
    }
    for (bool done = false; !done;) {
      if (!to_.RemoveSome(id, Records::Kinds::kAll, &done)) {
        return CannotCopy(
            Message("what an earlier copy has left cannot be removed: ", to_.trouble().message));
      }
    }
  }
  return Status::Ok();
}

// False: `trouble_` says what of `from` cannot be read, or `to` why it cannot be written.
bool Copy::PutAll(std::int64_t mesh, std::int64_t copy, const std::vector<Place>& places) {
  std::string record;
  for (std::size_t next = 0; next < places.size();) {
    const bool put = to_.Transact([&] {
      for (std::size_t bytes = 0; next < places.size() && bytes < kAtOnce; ++next) {
        Place place = places[next];
        place.mesh = mesh;
        trouble_ = ReadOf(&from_, "to be copied", place, &record);
        if (!trouble_.ok()) return false;
        place.mesh = copy;
        if (!to_.Put(place, record)) return false;
        bytes += record.size();
        bytes_ += record.size();
        ++records_;
      }
      return true;
    });
    if (!put) return false;
  }
  return true;
}

Status Copy::CompareMesh(std::int64_t mesh, std::int64_t copy, const std::vector<Place>& places) {
  std::vector<Place> copied;
  if (!to_.ListPlaces(copy, &copied)) return Unreadable("that were copied", &to_);
  std::erase(copied, Mark(copy));
  const auto differ = [&] {
    return CannotCopy(Message("mesh ", mesh, " is there already, as mesh ", copy,
                              ", with other records: it went on in one of the two; delete it in "
                              "the one where it must not go on"));
  };
  if (copied.size() != places.size()) return differ();
  std::string ours, theirs;
  for (std::size_t i = 0; i < places.size(); ++i) {
    Place place = places[i];
    place.mesh = copy;
    if (copied[i] != place) return differ();
    Status status = ReadOf(&to_, "that was copied", place, &theirs);
    place.mesh = mesh;
    if (status.ok()) status = ReadOf(&from_, "to be copied", place, &ours);
    if (!status.ok()) return status;
    if (ours != theirs) return differ();
  }
  return Status::Ok();
}

// Marked as incomplete until it is whole, and has been compared.
Status Copy::CopyMesh(std::int64_t mesh) {
  std::vector<Place> places;
  if (!from_.ListPlaces(mesh, &places)) return Unreadable("to be copied", &from_);
  std::int64_t copy = 0;
  const bool put = to_.Transact([&] {
    copy = to_.NewMesh();
    return to_.Put(Mark(copy), "");
  }) && PutAll(mesh, copy, places);
  if (!put) {
    if (!trouble_.ok()) return std::move(trouble_);
    return CannotCopy(Message("mesh ", mesh, " cannot be written: ", to_.trouble().message));
  }
  Status status = CompareMesh(mesh, copy, places);
  if (!status.ok()) return status;
  if (to_.Transact([&] { return to_.Remove(Mark(copy)); })) return Status::Ok();
  return CannotCopy(Message("mesh ", mesh, " cannot be written: ", to_.trouble().message));
}

core::Expected<std::string> Copy::Run() {
  Status status = RemoveHalves();
  if (!status.ok()) return tl::unexpected(std::move(status));
  std::uint64_t copied = 0, there = 0;
  for (const auto& [mesh, stored] : from_.TakeMeshes()) {
    if (stored.removed) continue;
    const std::string name = NameIn(stored);
    if (name.empty()) {
      return core::Refuse(core::StatusCode::kFailedPrecondition,
                          Message("mesh ", mesh, " to be copied makes no sense: salvage it first"));
    }
    if (const auto same = there_.find(name); same != there_.end()) {
      std::vector<Place> places;
      if (!from_.ListPlaces(mesh, &places)) {
        return tl::unexpected(Unreadable("to be copied", &from_));
      }
      status = CompareMesh(mesh, same->second, places);
      ++there;
    } else {
      status = CopyMesh(mesh);
      ++copied;
    }
    if (!status.ok()) return tl::unexpected(std::move(status));
  }
  return Message("copied ", copied, " meshes: ", records_, " records of ", bytes_,
                 " bytes, read back and compared; ", there, " were there already\n");
}

}  // namespace

core::Expected<std::string> CopyMeshes(const std::string& from, const std::string& to,
                                       const OpenRecordsOf& open_database) {
  if (from == to) return tl::unexpected(CannotCopy("the meshes are there: name two places"));
  auto source = OpenSide(from, /*may_be_new=*/false, open_database);
  if (!source) return tl::unexpected(std::move(source.error()));
  auto target = OpenSide(to, /*may_be_new=*/true, open_database);
  if (!target) return tl::unexpected(std::move(target.error()));
  return Copy(source->records.get(), target->records.get()).Run();
}

}  // namespace stellate::server
