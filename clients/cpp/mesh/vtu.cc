// VTK's XML files of unstructured grids.
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "mesh/formats.h"
#include "mesh/groups.h"
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

// A DataArray element with its numbers inline, as VTK reads them: the byte count, then the bytes.
template <typename Number>
std::string DataArray(const char* type, const char* name, int components, const Number* data,
                      Eigen::Index count, const std::string& more = "") {
  const std::uint64_t size = static_cast<std::uint64_t>(count) * sizeof(Number);
  std::string bytes(sizeof size + size, '\0');
  std::memcpy(bytes.data(), &size, sizeof size);
  if (size > 0) std::memcpy(bytes.data() + sizeof size, data, size);
  return std::string("<DataArray type=\"") + type + "\" Name=\"" + name +
         "\" NumberOfComponents=\"" + std::to_string(components) + "\"" + more +
         " format=\"binary\">" + Base64(bytes) + "</DataArray>\n";
}

template <typename Number>
std::string Field(const char* type, const char* name, const Number* data, size_t count) {
  return DataArray(type, name, 1, data, static_cast<Eigen::Index>(count),
                   " NumberOfTuples=\"" + std::to_string(count) + "\"");
}

// Text as its bytes, which every reader takes.
std::string Field(const char* name, const std::string& text) {
  return Field("UInt8", name, text.data(), text.size());
}

// What the file says of the whole mesh.
std::string FieldData(const Report& report, const std::vector<Group>& groups) {
  std::string xml = "<FieldData>\n" + Field("version", "stellate " STELLATE_VERSION);
  std::string names;
  for (const Group& group : groups) names += group.name + "\n";
  if (groups.size() > 1) xml += Field("groups", names);
  if (report.termination != Termination::kUnknown) {
    const std::uint8_t certified = report.certified() ? 1 : 0;
    xml +=
        Field("UInt8", "certified", &certified, 1) + Field("verdict", report.certificate.verdict);
  }
  if (report.epsilon > 0) xml += Field("Float64", "epsilon", &report.epsilon, 1);
  return xml + "</FieldData>\n";
}

std::string Cells(const std::vector<Group>& groups) {
  // vertex, line, triangle, tetrahedron
  constexpr std::array<std::uint8_t, 4> kCellTypes = {1, 3, 5, 10};
  std::vector<std::int64_t> connectivity, offsets;
  std::vector<std::uint8_t> types;
  for (const Group& group : groups) {
    const auto width = static_cast<size_t>(group.simplices.rows());
    for (const std::uint32_t id : group.simplices.reshaped()) connectivity.push_back(id);
    for (Eigen::Index j = 0; j < group.simplices.cols(); ++j) {
      const std::int64_t last = offsets.empty() ? 0 : offsets.back();
      offsets.push_back(last + static_cast<std::int64_t>(width));
      types.push_back(kCellTypes[width - 1]);
    }
  }
  const auto array = [](const char* type, const char* name, const auto& values) {
    return DataArray(type, name, 1, values.data(), std::ssize(values));
  };
  return "<Cells>\n" + array("Int64", "connectivity", connectivity) +
         array("Int64", "offsets", offsets) + array("UInt8", "types", types) + "</Cells>\n";
}

std::string PointData(const Mesh& mesh) {
  std::string xml;
  if (mesh.ambient_dimension() > 3) {
    xml += DataArray("Float64", "coordinates", mesh.ambient_dimension(), mesh.points.data(),
                     mesh.points.size());
  }
  if (!mesh.walls.empty()) {
    xml += DataArray("UInt64", "walls", 1, mesh.walls.data(), std::ssize(mesh.walls));
  }
  return xml.empty() ? xml : "<PointData>\n" + xml + "</PointData>\n";
}

// The groups of the cells, which are not all of one, and the labels of a mesh that has some.
std::string CellData(const std::vector<Group>& groups, bool has_labels) {
  std::vector<std::int32_t> tags, regions, sides;
  std::vector<std::uint64_t> walls;
  for (const Group& group : groups) {
    const auto count = static_cast<size_t>(group.simplices.cols());
    tags.insert(tags.end(), count, group.tag);
    walls.insert(walls.end(), count, group.walls);
    regions.insert(regions.end(), count, group.label);
    for (size_t j = 0; j < count; ++j) {
      const Sides of = group.sides.empty() ? Sides() : group.sides[j];
      sides.insert(sides.end(), {of.behind, of.ahead});
    }
  }
  std::string xml = DataArray("Int32", "group", 1, tags.data(), std::ssize(tags)) +
                    DataArray("UInt64", "walls", 1, walls.data(), std::ssize(walls));
  if (has_labels) {
    xml += DataArray("Int32", "region", 1, regions.data(), std::ssize(regions)) +
           DataArray("Int32", "sides", 2, sides.data(), std::ssize(sides));
  }
  return "<CellData>\n" + xml + "</CellData>\n";
}

}  // namespace

std::string Vtu(const Mesh& mesh) {
  const std::vector<Group> groups = GroupsOf(mesh);
  const Eigen::MatrixXd points = InSpace(mesh);
  std::string xml =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n" +
      FieldData(mesh.report, groups) + "<Piece NumberOfPoints=\"" + std::to_string(points.cols()) +
      "\" NumberOfCells=\"" + std::to_string(CountSimplices(groups)) + "\">\n<Points>\n" +
      DataArray("Float64", "Points", 3, points.data(), points.size()) + "</Points>\n" +
      Cells(groups) + PointData(mesh);
  const bool has_labels = !mesh.labels.empty() || mesh.is_boundary();
  if (groups.size() > 1 || has_labels) xml += CellData(groups, has_labels);
  return xml + "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

}  // namespace stellate::client
