#include "result.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include "core/base/arenas.h"
#include "mesh/streamed_file.h"
#include "run/delta_mesh.h"
#include "run/part_files.h"
#include "server/convert/mesh.h"
#include "server/convert/scale.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::mpi {
namespace {

constexpr std::size_t kPartBytes = std::size_t{3} << 20;

// The mesh as a server sends it, part by part, to take(part), which returns whether it wants more.
using TakePart = std::function<Expected<bool>(v1::DownloadMeshResponse&& part)>;
Expected<bool> ForEachPart(const Result& result, const TakePart& take) {
  const v1::MeshSpec& spec = result.mesh.spec();
  const Eigen::Map<const Eigen::VectorXd> scale(spec.scale().data(), spec.scale_size());
  const server::MeshHistory& history = *result.history;
  const server::MeshHistory::Snapshot size = history.At(history.revision());
  server::MeshHistory::Cursor cursor = history.BeginAt(history.revision(), 0);
  bool is_complete = false;
  while (!is_complete) {
    server::DeltaPart part = history.Next(&cursor, kPartBytes);
    server::ToOwnCoordinates(scale, &part.points);
    is_complete = part.complete;
    v1::DownloadMeshResponse message;
    server::ToProto(part, client::SimplexDimension(spec),
                    static_cast<int>(spec.ambient_dimension()), &message);
    message.set_vertices(size.vertices);
    message.set_simplices(size.simplices);
    Expected<bool> more = take(std::move(message));
    if (!more || !*more) return more;
  }
  return true;
}

// Nothing: the mesh has to be written whole.
Expected<std::optional<std::vector<Error>>> WriteAsItComes(const Result& result,
                                                           const std::vector<std::string>& paths) {
  const v1::MeshSpec& spec = result.mesh.spec();
  const bool can = std::all_of(paths.begin(), paths.end(), [&](const std::string& path) {
    return client::CanStream(path, client::SimplexDimension(spec),
                             static_cast<int>(spec.ambient_dimension()), spec.walls() > 0,
                             spec.boundary_only());
  });
  if (!can) return std::nullopt;
  client::PartFiles files(paths, result.mesh, client::ReportOf(result.mesh));
  const Expected<bool> taken = ForEachPart(result, [&](auto&& part) -> Expected<bool> {
    const auto one = files.Take(part);
    if (!one) return tl::unexpected(one.error());
    return *one == client::PartFiles::Taken::kYes;
  });
  if (!taken) return tl::unexpected(taken.error());
  if (!*taken) return std::nullopt;
  const Expected<bool> grouped = files.WriteGroups();
  if (!grouped) return tl::unexpected(grouped.error());
  if (!*grouped) return std::nullopt;
  return files.Finish();
}

}  // namespace

std::unique_ptr<server::MeshHistory> HistoryOf(const core::Mesher& mesher,
                                               core::Execution execution,
                                               std::vector<core::WallSet> walls) {
  const core::Specification& spec = mesher.specification();
  core::MeshDelta whole;
  whole.revision = 1;
  whole.points = mesher.Points();
  whole.added = mesher.Simplices();
  whole.labels = mesher.Labels();
  if (!walls.empty()) walls.resize(static_cast<std::size_t>(whole.points.cols()));
  whole.walls = std::move(walls);
  auto history = std::make_unique<server::MeshHistory>(
      spec.simplex_dimension(), spec.ambient_dimension, std::max(1, spec.labels_per_simplex()));
  if (const core::Status status = history->Append(whole); !status.ok())
    throw std::logic_error(status.message);
  whole = {};
  core::Interruption never;
  core::WithThreads(execution.threads, never, [&] { history->Orient(); });
  return history;
}

Expected<Mesh> WholeOf(const Result& result) {
  const v1::MeshSpec& spec = result.mesh.spec();
  auto builder =
      client::DeltaMesh::Create(client::SimplexDimension(spec),
                                static_cast<int>(spec.ambient_dimension()), spec.boundary_only());
  if (!builder) return tl::unexpected(builder.error());
  const Expected<bool> taken = ForEachPart(result, [&](auto&& part) -> Expected<bool> {
    if (auto ok = builder->Add(std::move(part)); !ok) return tl::unexpected(ok.error());
    return true;
  });
  if (!taken) return tl::unexpected(taken.error());
  Expected<Mesh> mesh = builder->Take();
  if (!mesh) return mesh;
  mesh->region_names.assign(spec.region_names().begin(), spec.region_names().end());
  mesh->report = client::ReportOf(result.mesh);
  return mesh;
}

SavedMesh Unsaved(const Result& result) {
  const v1::MeshSpec& spec = result.mesh.spec();
  const Report report = client::ReportOf(result.mesh);
  return {client::SimplexDimension(spec),
          static_cast<int>(spec.ambient_dimension()),
          report.counts.vertices,
          report.counts.simplices,
          report,
          {}};
}

std::vector<Error> Save(const Result& result, const std::vector<std::string>& paths) {
  if (paths.empty()) return {};
  auto failures = WriteAsItComes(result, paths);
  if (!failures) return {paths.size(), failures.error()};
  if (*failures) return std::move(**failures);
  const Expected<Mesh> mesh = WholeOf(result);
  if (!mesh) return {paths.size(), mesh.error()};
  std::vector<Error> unwritten;
  for (const std::string& path : paths)
    if (const Expected<void> written = mesh->Save(path); !written)
      unwritten.push_back(written.error());
  return unwritten;
}

}  // namespace stellate::mpi
