#include <algorithm>
#include <cctype>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mesh/formats.h"
#include "mesh/streamed_file.h"
#include "mesh/surface.h"
#include "mesh/write_file.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

using client::FileShape, client::Group, client::MeshWriter, client::TextLayout;

// What a format holds of a mesh.
enum class Holds {
  kRows,      // the simplices as they are
  kDrawn,     // turned to agree; of a solid its surface
  kPolygons,  // turned to agree, group by group; of a solid its boundary
  kGroups,    // turned to agree, group by group
};

struct FileFormat {
  const char* ending;
  int least_dimension, largest_dimension;  // of what it can hold
  int largest_ambient_dimension;
  const char* words;
  Holds holds;
  TextLayout (*layout)(const FileShape& shape);                   // null: it is binary
  bool surface_of_solids = false;                                 // in space, besides
  Expected<std::string> (*contents)(const Mesh& mesh) = nullptr;  // of what is written whole
};

constexpr int kAny = 1 << 30;
constexpr const char* kPly = ".ply";
constexpr FileFormat kFormats[] = {
    {".txt", 0, kAny, kAny, "anything", Holds::kRows, client::Txt},
    {".off", 1, 2, kAny, "curves and surfaces, and the surfaces of solids in space", Holds::kDrawn,
     client::Off, true},
    {".obj", 1, 2, 3, "curves and surfaces, and the surfaces of solids in space", Holds::kPolygons,
     client::Obj, true},
    {kPly, 1, 2, 3, "curves and surfaces, and the surfaces of solids in space", Holds::kDrawn,
     nullptr, true},
    {".stl", 2, 2, 3, "surfaces, and the surfaces of solids in space", Holds::kDrawn, nullptr, true,
     client::Stl},
    {".3mf", 2, 2, 3, "surfaces, and the surfaces of solids in space", Holds::kDrawn, nullptr, true,
     client::ThreeMf},
    {".glb", 2, 2, 3, "surfaces, and the surfaces of solids in space", Holds::kDrawn, nullptr, true,
     client::Glb},
    {".msh", 1, 3, 3, "simplices of dimension 3 at most", Holds::kGroups, client::Msh},
    {".vtu", 1, 3, kAny, "simplices of dimension 3 at most", Holds::kGroups, nullptr},
    {".npz", 0, kAny, kAny, "anything", Holds::kRows, nullptr, false, client::Npz},
    {".nas", 1, 3, 3, "simplices of dimension 3 at most", Holds::kGroups, nullptr, false,
     client::Nastran},
    {".bdf", 1, 3, 3, "simplices of dimension 3 at most", Holds::kGroups, nullptr, false,
     client::Nastran},
    {".fem", 1, 3, 3, "simplices of dimension 3 at most", Holds::kGroups, nullptr, false,
     client::Nastran},
};

constexpr const char* kPieces = "; .pvtu is written by stellate-mpi, a piece a rank";

bool CanHold(const FileFormat& format, int k, int d) {
  if (format.surface_of_solids && k == 3 && d == 3) return true;
  return format.least_dimension <= k && k <= format.largest_dimension &&
         d <= format.largest_ambient_dimension;
}

std::string EndingOf(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending;
}

Expected<const FileFormat*> Choose(const std::string& path, int k, int d) {
  std::string able;
  for (const FileFormat& format : kFormats) {
    if (CanHold(format, k, d)) able += std::string(" ") + format.ending;
  }
  const std::string ending = EndingOf(path);
  const auto* const format = std::find_if(std::begin(kFormats), std::end(kFormats),
                                          [&](const FileFormat& f) { return ending == f.ending; });
  if (format == std::end(kFormats)) {
    return Fail(ErrorCode::kFileFailed, "no format is known by the ending '" + ending + "' of " +
                                            path + "; known for this mesh:" + able +
                                            (ending == ".pvtu" ? kPieces : ""));
  }
  if (CanHold(*format, k, d)) return format;
  const bool high = k >= format->least_dimension && k <= format->largest_dimension;
  return Fail(ErrorCode::kFileFailed,
              ending + " holds " + (high ? "points of space" : format->words) + ", and " + path +
                  " would get a mesh of dimension " + std::to_string(k) + " in R^" +
                  std::to_string(d) + "; known for it:" + able);
}

std::unique_ptr<MeshWriter> WriterOf(const FileFormat& format, client::Draft draft,
                                     const FileShape& shape,
                                     const std::vector<Group>* groups = nullptr) {
  if (format.layout != nullptr)
    return client::MakeTextWriter(std::move(draft), format.layout(shape));
  if (format.ending == kPly) return client::MakePlyWriter(std::move(draft), shape);
  return client::MakeVtuWriter(std::move(draft), shape, groups);
}

// Those of all groups that it holds; none where it is not known on what walls a solid ends, of
// which it holds the boundary alone.
std::optional<std::vector<Group>> Held(const FileFormat& format, std::vector<Group> groups) {
  if (format.holds == Holds::kGroups) return groups;
  if (groups.size() > 1) {
    std::erase_if(groups, [](const Group& group) { return group.dimension() == 3; });
    return groups;
  }
  if (groups[0].dimension() == 3) return std::nullopt;
  groups[0].name.clear();
  return groups;
}

// The simplices that a format holds, and the points of those that it draws.
std::vector<Group> GroupsOf(const FileFormat& format, const Mesh& mesh, Eigen::MatrixXd* drawn) {
  if (format.holds == Holds::kRows) return {{1, "", 0, mesh.simplices}};
  if (format.holds == Holds::kDrawn) {
    if (mesh.dimension() < 3) return {{1, "", 0, OrientedSimplices(mesh)}};
    client::Drawn surface = client::DrawnOf(mesh);
    *drawn = std::move(surface.points);
    return {{1, "", 0, std::move(surface.simplices)}};
  }
  std::vector<Group> groups = client::GroupsOf(mesh);
  if (auto held = Held(format, groups)) return *std::move(held);
  groups[0].name.clear();
  groups[0].simplices = client::BoundaryOf(groups[0].simplices);
  return {std::move(groups[0])};
}

void AddTo(FileShape* shape, const Group& group, std::uint64_t count) {
  shape->groups.push_back({group.dimension(), count, group.tag, group.name});
}

Expected<void> Write(const FileFormat& format, const Mesh& mesh, client::Draft draft) {
  Eigen::MatrixXd drawn;
  const std::vector<Group> groups = GroupsOf(format, mesh, &drawn);
  const Eigen::MatrixXd& points = drawn.size() > 0 ? drawn : mesh.points;
  FileShape shape{mesh.dimension(), mesh.ambient_dimension(),
                  static_cast<std::uint64_t>(points.cols())};
  for (const Group& group : groups)
    AddTo(&shape, group, static_cast<std::uint64_t>(group.simplices.cols()));
  shape.report = mesh.report;
  shape.has_labels = !mesh.labels.empty() || mesh.is_boundary();
  if (!mesh.walls.empty()) shape.walls.emplace();
  for (std::size_t i = 0; i < mesh.walls.size(); ++i) {
    if (mesh.walls[i] == 0) continue;
    shape.walls->on.push_back(static_cast<std::uint32_t>(i));
    shape.walls->bits.push_back(mesh.walls[i]);
  }
  const auto writer = WriterOf(format, std::move(draft), shape, &groups);
  if (auto ok = writer->AddPoints(points); !ok) return ok;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (auto ok = writer->AddCells(i, groups[i].simplices); !ok) return ok;
  }
  return writer->Finish();
}

}  // namespace

Expected<void> CheckSave(const std::string& path, int dimension, int ambient_dimension) {
  const auto format = Choose(path, dimension, ambient_dimension);
  if (!format) return tl::unexpected(format.error());
  return client::CheckWrite(path);
}

Expected<void> Mesh::Save(const std::string& path) const {
  const auto format = Choose(path, dimension(), ambient_dimension());
  if (!format) return tl::unexpected(format.error());
  if ((*format)->contents != nullptr) {
    const Expected<std::string> bytes = (*format)->contents(*this);
    if (!bytes) return tl::unexpected(bytes.error());
    return client::WriteFile(path, *bytes);
  }
  Expected<client::Draft> draft = client::Draft::Begin(path);
  if (!draft) return tl::unexpected(draft.error());
  return Write(**format, *this, std::move(*draft));
}

namespace client {

bool CanStream(const std::string& path, int k, int d, bool has_walls, bool is_boundary) {
  const auto format = Choose(path, k, d);
  if (!format || (*format)->contents != nullptr || Draft::IsSpecial(path)) return false;
  const Holds holds = (*format)->holds;
  if (holds == Holds::kRows) return true;
  if (holds == Holds::kDrawn) return k < 3;
  if (has_walls) return !is_boundary;
  return k < 3 || holds == Holds::kGroups;
}

bool NeedsGroups(const std::string& path, int k, int d, bool has_walls) {
  const auto format = Choose(path, k, d);
  return has_walls && format &&
         ((*format)->holds == Holds::kPolygons || (*format)->holds == Holds::kGroups);
}

Expected<bool> SaveSpooled(const std::string& path, const Spool& spool, FileShape shape) {
  const auto format = Choose(path, shape.dimension, shape.ambient_dimension);
  if (!format) return tl::unexpected(format.error());
  const std::optional<std::vector<Group>> groups = Held(**format, spool.Groups());
  if (!groups) return false;
  for (const Group& group : *groups) {
    const bool is_region = group.dimension() == shape.dimension;
    AddTo(&shape, group,
          is_region ? spool.CountOf(group.label)
                    : static_cast<std::uint64_t>(group.simplices.cols()));
  }
  shape.has_labels = spool.has_labels();
  if (!spool.walls().on.empty()) shape.walls = spool.walls();
  Expected<Draft> draft = Draft::Begin(path);
  if (!draft) return tl::unexpected(draft.error());
  const auto writer = WriterOf(**format, std::move(*draft), shape, &*groups);
  auto ok =
      spool.EachPoints([&](const Eigen::MatrixXd& points) { return writer->AddPoints(points); });
  for (std::size_t i = 0; ok && i < groups->size(); ++i) {
    const Group& group = (*groups)[i];
    const auto add = [&](const SimplexMatrix& cells) { return writer->AddCells(i, cells); };
    ok = group.dimension() == shape.dimension ? spool.EachCells(group.label, add)
                                              : add(group.simplices);
  }
  if (ok) ok = writer->Finish();
  if (!ok) return tl::unexpected(ok.error());
  return true;
}

Expected<StreamedFile> StreamedFile::Begin(const std::string& path, const FileShape& shape) {
  const auto format = Choose(path, shape.dimension, shape.ambient_dimension);
  if (!format) return tl::unexpected(format.error());
  Expected<Draft> draft = Draft::Begin(path);
  if (!draft) return tl::unexpected(draft.error());
  return StreamedFile{WriterOf(**format, std::move(*draft), shape),
                      (*format)->holds != Holds::kRows};
}

}  // namespace client
}  // namespace stellate
