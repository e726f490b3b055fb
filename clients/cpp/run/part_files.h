#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mesh/formats.h"
#include "mesh/spool.h"
#include "mesh/streamed_file.h"
#include "stellate/download.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::client {

// A download that goes into files part by part; no part is kept. For the last revision of a
// mesh that is over, whose simplices come in lexicographic order and with their orientation: of
// another Take says so, and nothing is written.
//
//   PartFiles files(paths, mesh, report);
//   while (...) if (auto ok = files.Take(part); !ok) ...;
//   if (auto ok = files.WriteGroups(); !ok) ...;
//   const std::vector<Error> failures = files.Finish();
class PartFiles {
 public:
  PartFiles(std::vector<std::string> paths, const v1::Mesh& mesh, Report report);

  // kNotSo: the part does not come as it has to; take the mesh whole. Errors: what does not follow
  // on the parts before it; that no file can be written any more.
  enum class Taken { kYes, kNotSo };
  Expected<Taken> Take(const v1::DownloadMeshResponse& part);
  std::uint64_t vertices() const { return vertices_; }    // so far
  std::uint64_t simplices() const { return simplices_; }  // so far

  // Writes what is grouped by walls and regions. Call it once all vertices and simplices that were
  // announced are there. False: take the mesh whole.
  Expected<bool> WriteGroups();

  // Puts the files in their places; what could not be written, file by file.
  std::vector<Error> Finish();

 private:
  Expected<void> Begin(const v1::DownloadMeshResponse& part);
  Expected<void> TakePoints(const v1::DownloadMeshResponse& part);
  Expected<void> TakeWalls(const v1::DownloadMeshResponse& part, std::uint64_t before);
  Expected<void> SpoolCells(const v1::DownloadMeshResponse& part);
  Expected<void> GiveUpSpool(const Error& why);
  // False: not in order.
  Expected<bool> ReadCells(const v1::DownloadMeshResponse& part);
  template <typename Write>
  Expected<void> ToAll(const Write& write);

  std::vector<std::string> paths_, grouped_;  // the latter by way of the spool
  std::vector<std::string> region_names_;
  std::optional<Spool> spool_;
  FileShape shape_;
  std::vector<StreamedFile> files_;
  std::vector<Error> failures_;
  bool is_begun_ = false;
  std::uint64_t vertices_ = 0, simplices_ = 0;
  SimplexMatrix ascending_, turned_;  // of the part
  std::vector<std::uint32_t> last_;   // the simplex before it
};

}  // namespace stellate::client
