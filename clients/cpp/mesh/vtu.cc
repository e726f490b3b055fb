// VTK's XML files of unstructured grids.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mesh/formats.h"
#include "mesh/groups.h"
#include "mesh/xml.h"
#include "stellate/version.h"

namespace stellate::client {
namespace {

std::string Base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t triple = 0;
    for (size_t j = 0; j < 3; ++j) {
      triple = triple << 8 | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0u);
    }
    for (size_t j = 0; j < 4; ++j) {
      text += i + j <= bytes.size() ? kDigits[triple >> (18 - 6 * j) & 63] : '=';
    }
  }
  return text;
}

// A DataArray element of FieldData with its numbers inline, as VTK reads them: the byte count, then
// the bytes.
template <typename Number>
std::string Field(const char* type, const char* name, const Number* data, std::size_t count) {
  const std::uint64_t size = count * sizeof(Number);
  std::string bytes(sizeof size + size, '\0');
  std::memcpy(bytes.data(), &size, sizeof size);
  if (size > 0) std::memcpy(bytes.data() + sizeof size, data, size);
  return std::string("<DataArray type=\"") + type + "\" Name=\"" + name +
         "\" NumberOfComponents=\"1\" NumberOfTuples=\"" + std::to_string(count) +
         "\" format=\"binary\">" + Base64(bytes) + "</DataArray>\n";
}

// Text as its bytes, which every reader takes.
std::string Field(const char* name, const std::string& text) {
  return Field("UInt8", name, text.data(), text.size());
}

// What the file says of the whole mesh.
std::string FieldData(const FileShape& shape) {
  std::string xml = "<FieldData>\n" + Field("version", "stellate " STELLATE_VERSION);
  std::string names;
  for (const FileShape::Cells& cells : shape.groups) names += cells.name + "\n";
  if (shape.groups.size() > 1) xml += Field("groups", names);
  const Report& report = shape.report;
  if (report.termination != Termination::kUnknown) {
    const std::uint8_t certified = report.certified() ? 1 : 0;
    xml +=
        Field("UInt8", "certified", &certified, 1) + Field("verdict", report.certificate.verdict);
  }
  if (report.epsilon > 0) xml += Field("Float64", "epsilon", &report.epsilon, 1);
  return xml + "</FieldData>\n";
}

// The appended arrays in the order of the file, wider numbers first: each number begins at a
// multiple of its size, so that a file can be mapped into memory.
enum ArrayName {
  kPoints,
  kCoordinates,
  kPointWalls,
  kPointIds,
  kConnectivity,
  kOffsets,
  kCellWalls,
  kGroup,
  kRegion,
  kSides,
  kTypes,
  kArrays
};

constexpr const char* kGlobalIds = "GlobalPointIds";  // as VTK's own filters call them

struct Appended {
  const char *type, *name;
  int components = 1;
  std::uint64_t row_bytes = 0, rows = 0;
  bool is_there = true;
  std::uint64_t place = 0;    // in the file, of the byte count before it
  std::uint64_t written = 0;  // without that
  bool is_begun = false;

  std::uint64_t bytes() const { return row_bytes * rows; }
};

using Arrays = std::array<Appended, kArrays>;

Arrays ArraysOf(const FileShape& shape) {
  const std::uint64_t n = shape.vertices, m = shape.simplices();
  const auto d = static_cast<std::uint64_t>(shape.ambient_dimension);
  const bool has_walls = shape.walls.has_value(), has_labels = shape.has_labels;
  const bool has_groups = shape.groups.size() > 1 || has_labels;
  std::uint64_t ids = 0;
  for (const FileShape::Cells& cells : shape.groups)
    ids += cells.count * (static_cast<std::uint64_t>(cells.dimension) + 1);
  return {{
      {"Float64", "Points", 3, 24, n},
      {"Float64", "coordinates", shape.ambient_dimension, 8 * d, n, d > 3},
      {"UInt64", "walls", 1, 8, n, has_walls},
      {"Int64", kGlobalIds, 1, 8, n, shape.point_ids.has_value()},
      {"Int64", "connectivity", 1, 8, ids},
      {"Int64", "offsets", 1, 8, m},
      {"UInt64", "walls", 1, 8, m, has_groups},
      {"Int32", "group", 1, 4, m, has_groups},
      {"Int32", "region", 1, 4, m, has_labels},
      {"Int32", "sides", 2, 8, m, has_labels},
      {"UInt8", "types", 1, 1, m},
  }};
}

// An element with one for each of the arrays that are there; empty where none is. `prefix`: of the
// names of all, "P" in an index, which says no more of an array; else with its offset.
std::string Section(const Arrays& arrays, const std::string& prefix, const std::string& name,
                    const std::vector<ArrayName>& those) {
  std::string xml;
  bool has_ids = false;
  for (const ArrayName which : those) {
    const Appended& array = arrays[which];
    if (!array.is_there) continue;
    has_ids |= which == kPointIds;
    xml += "<" + prefix + "DataArray type=\"" + array.type + "\"" +
           (which == kPointIds ? " IdType=\"1\"" : "") + " Name=\"" + array.name +
           "\" NumberOfComponents=\"" + std::to_string(array.components) + "\"";
    std::uint64_t offset = 0;
    for (std::size_t i = 0; i < which; ++i)
      if (arrays[i].is_there) offset += sizeof(std::uint64_t) + arrays[i].bytes();
    if (prefix.empty()) xml += " format=\"appended\" offset=\"" + std::to_string(offset) + "\"";
    xml += "/>\n";
  }
  if (xml.empty()) return xml;
  const std::string ids = has_ids ? std::string(" GlobalIds=\"") + kGlobalIds + "\"" : "";
  const std::string element = prefix + name;
  return "<" + element + ids + ">\n" + xml + "</" + element + ">\n";
}

// The data of points and cells, as a file and an index of files say it alike.
std::string DataSections(const Arrays& arrays, const std::string& prefix) {
  return Section(arrays, prefix, "PointData", {kCoordinates, kPointWalls, kPointIds}) +
         Section(arrays, prefix, "CellData", {kGroup, kCellWalls, kRegion, kSides});
}

constexpr const char* kFileHead =
    "\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n";

class VtuWriter final : public MeshWriter {
 public:
  VtuWriter(Draft draft, FileShape shape, const std::vector<Group>* groups)
      : draft_(std::move(draft)),
        shape_(std::move(shape)),
        groups_(groups),
        arrays_(ArraysOf(shape_)),
        head_(Head()) {
    std::uint64_t place = head_.size();
    for (Appended& array : arrays_) {
      if (!array.is_there) continue;
      array.place = place;
      place += sizeof(std::uint64_t) + array.bytes();
    }
    end_ = place;
  }

  Expected<void> AddPoints(const Eigen::Ref<const Eigen::MatrixXd>& points) override {
    const Eigen::MatrixXd space = InSpace(points);
    if (auto ok = Append(kPoints, space.data(), space.size()); !ok) return ok;
    if (!arrays_[kCoordinates].is_there) return {};
    const Eigen::MatrixXd dense = points;
    return Append(kCoordinates, dense.data(), dense.size());
  }

  Expected<void> AddCells(std::size_t /*group*/,
                          const Eigen::Ref<const SimplexMatrix>& cells) override {
    if (auto ok = AddPointData(); !ok) return ok;
    constexpr auto kCols = static_cast<Eigen::Index>(kBlockRows);
    for (Eigen::Index first = 0; first < cells.cols(); first += kCols) {
      const Eigen::Matrix<std::int64_t, Eigen::Dynamic, Eigen::Dynamic> ids =
          cells.middleCols(first, std::min(kCols, cells.cols() - first)).cast<std::int64_t>();
      if (auto ok = Append(kConnectivity, ids.data(), ids.size()); !ok) return ok;
    }
    return {};
  }

  Expected<void> Finish() override {
    const auto ok = Complete();
    return ok ? draft_.Finish() : ok;
  }

  // All that it does but take its place.
  Expected<Draft> TakeWhole() {
    if (auto ok = Complete(); !ok) return tl::unexpected(ok.error());
    if (auto ok = draft_.Keep(); !ok) return tl::unexpected(ok.error());
    return std::move(draft_);
  }

 private:
  Expected<void> Complete() {
    if (auto ok = AddPointData(); !ok) return ok;
    for (const ArrayName name : {kPoints, kCoordinates, kPointWalls, kPointIds, kConnectivity}) {
      if (auto ok = Begin(name); !ok) return ok;  // where there is nothing
    }
    std::int64_t last = 0;
    auto ok = Fill<std::int64_t>(kOffsets, [&last](std::size_t width, const Group*, std::size_t) {
      return last += static_cast<std::int64_t>(width);
    });
    if (ok) {
      ok = Fill<std::uint64_t>(
          kCellWalls, [](std::size_t, const Group* group, std::size_t) { return group->walls; });
    }
    if (ok) {
      ok = Fill<std::int32_t>(
          kGroup, [](std::size_t, const Group* group, std::size_t) { return group->tag; });
    }
    if (ok) {
      ok = Fill<std::int32_t>(
          kRegion, [](std::size_t, const Group* group, std::size_t) { return group->label; });
    }
    if (ok) {
      ok = Fill<std::array<std::int32_t, 2>>(
          kSides, [](std::size_t, const Group* group, std::size_t j) {
            const Sides sides = group->sides.empty() ? Sides() : group->sides[j];
            return std::array<std::int32_t, 2>{sides.behind, sides.ahead};
          });
    }
    if (ok) {
      // vertex, line, triangle, tetrahedron
      constexpr std::array<std::uint8_t, 4> kCellTypes = {1, 3, 5, 10};
      ok = Fill<std::uint8_t>(kTypes, [&kCellTypes](std::size_t width, const Group*, std::size_t) {
        return kCellTypes[width - 1];
      });
    }
    if (ok) ok = draft_.WriteAt(end_, "\n</AppendedData>\n</VTKFile>\n");
    return ok;
  }

  // Up to the first array's byte count, which begins at a multiple of 8.
  std::string Head() const {
    std::string xml = std::string("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid") +
                      kFileHead + "<UnstructuredGrid>\n" + FieldData(shape_) +
                      "<Piece NumberOfPoints=\"" + std::to_string(shape_.vertices) +
                      "\" NumberOfCells=\"" + std::to_string(shape_.simplices()) + "\">\n" +
                      Section(arrays_, "", "Points", {kPoints}) +
                      Section(arrays_, "", "Cells", {kConnectivity, kOffsets, kTypes}) +
                      DataSections(arrays_, "") +
                      "</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n";
    while (xml.size() % 8 != 7) xml += ' ';
    return xml + "_";
  }

  // Writes the byte count before an array, and what comes before the first one.
  Expected<void> Begin(ArrayName name) {
    Appended& array = arrays_[name];
    if (!array.is_there || std::exchange(array.is_begun, true)) return {};
    if (!head_.empty()) {
      if (auto ok = draft_.WriteAt(0, std::exchange(head_, {})); !ok) return ok;
    }
    const std::uint64_t size = array.bytes();
    return draft_.WriteAt(array.place, {reinterpret_cast<const char*>(&size), sizeof size});
  }

  template <typename Number>
  Expected<void> Append(ArrayName name, const Number* data, Eigen::Index count) {
    if (auto ok = Begin(name); !ok) return ok;
    Appended& array = arrays_[name];
    const std::string_view bytes(reinterpret_cast<const char*>(data),
                                 static_cast<std::size_t>(count) * sizeof(Number));
    const std::uint64_t place = array.place + sizeof(std::uint64_t) + array.written;
    array.written += bytes.size();
    return draft_.WriteAt(place, bytes);
  }

  Expected<void> AddPointData() {
    if (auto ok = AddWalls(); !ok) return ok;
    const Appended& ids = arrays_[kPointIds];
    if (!ids.is_there || ids.is_begun) return {};
    return Append(kPointIds, shape_.point_ids->data(), std::ssize(*shape_.point_ids));
  }

  Expected<void> AddWalls() {
    if (!arrays_[kPointWalls].is_there || arrays_[kPointWalls].is_begun) return {};
    const PointWalls& walls = *shape_.walls;
    std::size_t next = 0;
    for (std::uint64_t first = 0; first < shape_.vertices; first += kBlockRows) {
      const std::uint64_t last = std::min(shape_.vertices, first + kBlockRows);
      std::vector<std::uint64_t> block(last - first);
      for (; next < walls.on.size() && walls.on[next] < last; ++next)
        block[walls.on[next] - first] = walls.bits[next];
      if (auto ok = Append(kPointWalls, block.data(), std::ssize(block)); !ok) return ok;
    }
    return Begin(kPointWalls);
  }

  // One row a simplex: row(vertices of it, its group if there are any, its number there).
  template <typename Number, typename Row>
  Expected<void> Fill(ArrayName name, const Row& row) {
    if (!arrays_[name].is_there) return {};
    if (auto ok = Begin(name); !ok) return ok;
    std::vector<Number> block;
    const auto flush = [&] {
      auto ok = Append(name, block.data(), std::ssize(block));
      block.clear();
      return ok;
    };
    for (std::size_t g = 0; g < shape_.groups.size(); ++g) {
      const FileShape::Cells& cells = shape_.groups[g];
      const Group* const group = groups_ == nullptr ? nullptr : &(*groups_)[g];
      for (std::uint64_t j = 0; j < cells.count; ++j) {
        block.push_back(row(static_cast<std::size_t>(cells.dimension) + 1, group, j));
        if (block.size() < kBlockRows) continue;
        if (auto ok = flush(); !ok) return ok;
      }
    }
    return flush();
  }

  Draft draft_;
  FileShape shape_;
  const std::vector<Group>* groups_;
  Arrays arrays_;
  std::string head_;  // until it is written
  std::uint64_t end_ = 0;
};

}  // namespace

std::unique_ptr<MeshWriter> MakeVtuWriter(Draft draft, FileShape shape,
                                          const std::vector<Group>* groups) {
  return std::make_unique<VtuWriter>(std::move(draft), std::move(shape), groups);
}

Expected<Draft> WriteVtuPiece(Draft draft, FileShape shape, const Eigen::MatrixXd& points,
                              const std::vector<Group>& groups) {
  VtuWriter writer(std::move(draft), std::move(shape), &groups);
  if (auto ok = writer.AddPoints(points); !ok) return tl::unexpected(ok.error());
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (auto ok = writer.AddCells(i, groups[i].simplices); !ok) return tl::unexpected(ok.error());
  return writer.TakeWhole();
}

std::string VtuIndex(const FileShape& shape, const std::vector<std::string>& sources) {
  const Arrays arrays = ArraysOf(shape);
  std::string xml = std::string("<?xml version=\"1.0\"?>\n<VTKFile type=\"PUnstructuredGrid") +
                    kFileHead + "<PUnstructuredGrid GhostLevel=\"0\">\n" + FieldData(shape) +
                    Section(arrays, "P", "Points", {kPoints}) + DataSections(arrays, "P");
  for (const std::string& source : sources)
    xml += "<Piece Source=\"" + EscapedXml(source) + "\"/>\n";
  return xml + "</PUnstructuredGrid>\n</VTKFile>\n";
}

}  // namespace stellate::client
