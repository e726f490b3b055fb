#include "mesh/piece.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <system_error>
#include <utility>

#include "mesh/formats.h"

namespace stellate::client {
namespace {

namespace fs = std::filesystem;
using Eigen::Index;

constexpr int kMostDimension = 3;  // of cells that VTK has

// A group without its simplices.
Group Empty(const Group& group) { return {group.tag, group.name, group.walls, {}, group.label}; }

// The simplices of a group whose lowest vertex is owned.
Group OwnedOf(const Group& group, const std::vector<bool>& owned) {
  std::vector<Index> own;
  for (Index j = 0; j < group.simplices.cols(); ++j)
    if (owned[group.simplices.col(j).minCoeff()]) own.push_back(j);
  Group kept = Empty(group);
  kept.simplices = group.simplices(Eigen::indexing::all, own);
  for (std::size_t i = 0; !group.sides.empty() && i < own.size(); ++i)
    kept.sides.push_back(group.sides[static_cast<std::size_t>(own[i])]);
  return kept;
}

void Mark(const std::vector<Group>& groups, std::vector<bool>* marks) {
  for (const Group& group : groups)
    for (const std::uint32_t id : group.simplices.reshaped()) (*marks)[id] = true;
}

// What a piece has, ahead of its points: all that an index says of it, too.
FileShape ShapeOf(const Mesh& mesh, const std::vector<Group>& groups) {
  FileShape shape{mesh.dimension(), mesh.ambient_dimension()};
  for (const Group& group : groups)
    shape.groups.push_back({group.dimension(), static_cast<std::uint64_t>(group.simplices.cols()),
                            group.tag, group.name});
  shape.report = mesh.report;
  shape.has_labels = !mesh.labels.empty() || mesh.is_boundary();
  if (!mesh.walls.empty()) shape.walls.emplace();
  shape.point_ids.emplace();
  return shape;
}

}  // namespace

PiecePaths::PiecePaths(const std::string& index) : given_(index) {
  std::error_code unknown;
  const fs::path target = fs::weakly_canonical(index, unknown);
  index_ = unknown ? index : target.string();
  folder_ = fs::path(index_).replace_extension().string();
}

bool PiecePaths::AreMeantBy(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending == ".pvtu";
}

std::string PiecePaths::NameOf(std::size_t piece) const {
  return fs::path(folder_).filename().string() + "_" + std::to_string(piece) + ".vtu";
}

Expected<void> PiecePaths::Check(int dimension, int ambient_dimension, std::size_t piece) const {
  if (dimension < 1 || dimension > kMostDimension)
    return Fail(ErrorCode::kFileFailed, ".pvtu holds simplices of dimension 3 at most, and " +
                                            given_ + " would get a mesh of dimension " +
                                            std::to_string(dimension) + " in R^" +
                                            std::to_string(ambient_dimension));
  if (Draft::IsSpecial(index_))
    return Fail(ErrorCode::kFileFailed, "cannot write " + given_ + ": it is no regular file");
  if (auto ok = CheckWrite(index_); !ok) return ok;
  std::error_code unknown;
  if (!fs::exists(folder_, unknown)) return {};  // made beside the index
  return CheckWrite(Piece(piece));
}

Expected<bool> PiecePaths::MakeFolder() const {
  std::error_code failed;
  const bool made = fs::create_directory(folder_, failed);
  if (!failed) return made;
  return Fail(ErrorCode::kFileFailed,
              "cannot make the folder " + folder_ + ": " + failed.message());
}

Expected<void> PiecePaths::DropIndex() const {
  std::error_code failed;
  fs::remove(index_, failed);
  if (!failed) return {};
  return Fail(ErrorCode::kFileFailed, "cannot replace " + given_ + ": " + failed.message());
}

bool PiecePaths::DropPiece(std::size_t piece) const {
  std::error_code failed;
  return fs::remove(Piece(piece), failed);
}

void PiecePaths::DropEmptyFolder() const {
  std::error_code failed;
  fs::remove(folder_, failed);
}

std::string PiecePaths::IndexOf(const Mesh& mesh, const std::vector<Group>& groups,
                                std::size_t pieces) const {
  std::vector<std::string> sources;
  const std::string folder = fs::path(folder_).filename().string();
  for (std::size_t piece = 0; piece < pieces; ++piece)
    sources.push_back(folder + "/" + NameOf(piece));
  return VtuIndex(ShapeOf(mesh, groups), sources);
}

Expected<Draft> WritePiece(Draft draft, const Mesh& mesh, const std::vector<Group>& groups,
                           const std::vector<bool>& owned) {
  std::vector<Group> own;
  own.reserve(groups.size());
  for (const Group& group : groups) own.push_back(OwnedOf(group, owned));
  FileShape shape = ShapeOf(mesh, own);
  std::vector<bool> here(owned.size()), anywhere(owned.size());
  Mark(own, &here);
  Mark(groups, &anywhere);
  std::vector<std::int64_t>& ids = *shape.point_ids;
  std::vector<std::uint32_t> places(owned.size());
  for (std::size_t i = 0; i < owned.size(); ++i) {
    if (!here[i] && !(owned[i] && !anywhere[i])) continue;
    places[i] = static_cast<std::uint32_t>(ids.size());
    if (shape.walls && mesh.walls[i] != 0) {
      shape.walls->on.push_back(places[i]);
      shape.walls->bits.push_back(mesh.walls[i]);
    }
    ids.push_back(static_cast<std::int64_t>(i));
  }
  for (Group& group : own)
    for (std::uint32_t& id : group.simplices.reshaped()) id = places[id];
  shape.vertices = ids.size();
  const Eigen::MatrixXd points = mesh.points(Eigen::indexing::all, ids);
  return WriteVtuPiece(std::move(draft), std::move(shape), points, own);
}

}  // namespace stellate::client
