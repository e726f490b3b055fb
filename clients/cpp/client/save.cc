#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <type_traits>
#include <vector>

#include "stellate/mesh.h"
#include "write_file.h"

namespace stellate {
namespace {

// Text that grows by snprintf's formats.
class Text {
 public:
  void Add(std::string_view piece) { text_ += piece; }
  void Add(double value) {
    char number[32];
    std::snprintf(number, sizeof number, "%.17g", value);
    text_ += number;
  }
  template <typename Columns>
  void AddNumbers(const Columns& column) {
    for (Eigen::Index i = 0; i < column.size(); ++i) {
      if (i > 0) text_ += ' ';
      if constexpr (std::is_floating_point_v<typename Columns::Scalar>) {
        Add(column[i]);
      } else {
        text_ += std::to_string(column[i]);
      }
    }
  }
  // A line for each column: the prefix and the column's numbers.
  template <typename Matrix>
  void AddLines(std::string_view prefix, const Matrix& matrix) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
      text_ += prefix;
      AddNumbers(matrix.col(j));
      text_ += '\n';
    }
  }
  const std::string& str() const { return text_; }

 private:
  std::string text_;
};

tl::unexpected<Error> CannotHold(const std::string& why) {
  return Fail(ErrorCode::kFileFailed, why);
}

Expected<void> CheckCurveOrSurface(const Mesh& mesh, const char* format) {
  if (mesh.dimension() <= 2) return {};
  return CannotHold(std::string(format) +
                    " holds curves and surfaces, and this mesh has dimension " +
                    std::to_string(mesh.dimension()) +
                    (mesh.dimension() == 3 ? "; save it as .vtu or .txt" : "; save it as .txt"));
}

// The first three coordinates, zeros added.
Eigen::MatrixXd InSpace(const Mesh& mesh) {
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(3, mesh.points.cols());
  const Eigen::Index rows = std::min<Eigen::Index>(3, mesh.points.rows());
  points.topRows(rows) = mesh.points.topRows(rows);
  return points;
}

Expected<void> CheckInSpace(const Mesh& mesh, const char* format) {
  if (mesh.ambient_dimension() <= 3) return {};
  return CannotHold(std::string(format) + " holds points of space, and these have " +
                    std::to_string(mesh.ambient_dimension()) +
                    " coordinates; save them as .txt or .off (all coordinates) or .vtu (the first "
                    "three, all of them as point data)");
}

Expected<std::string> Txt(const Mesh& mesh) {
  Text text;
  text.Add(std::to_string(mesh.dimension()) + " " + std::to_string(mesh.ambient_dimension()) + " " +
           std::to_string(mesh.points.cols()) + " " + std::to_string(mesh.simplices.cols()) + "\n");
  text.AddLines("", mesh.points);
  text.AddLines("", mesh.simplices);
  return text.str();
}

Expected<std::string> Off(const Mesh& mesh) {
  if (const auto ok = CheckCurveOrSurface(mesh, "OFF"); !ok) return tl::unexpected(ok.error());
  Text text;
  text.Add(mesh.ambient_dimension() == 3
               ? "OFF\n"
               : "nOFF\n" + std::to_string(mesh.ambient_dimension()) + "\n");
  text.Add(std::to_string(mesh.points.cols()) + " " + std::to_string(mesh.simplices.cols()) +
           " 0\n");
  text.AddLines("", mesh.points);
  text.AddLines(std::to_string(mesh.simplices.rows()) + " ", OrientedSimplices(mesh.simplices));
  return text.str();
}

Expected<std::string> Obj(const Mesh& mesh) {
  if (const auto ok = CheckInSpace(mesh, "OBJ"); !ok) return tl::unexpected(ok.error());
  if (const auto ok = CheckCurveOrSurface(mesh, "OBJ"); !ok) return tl::unexpected(ok.error());
  Text text;
  text.AddLines("v ", InSpace(mesh));
  const SimplexMatrix from_one = OrientedSimplices(mesh.simplices).array() + 1;
  text.AddLines(mesh.dimension() == 1 ? "l " : "f ", from_one);
  return text.str();
}

Expected<std::string> Ply(const Mesh& mesh) {
  if (const auto ok = CheckInSpace(mesh, "PLY"); !ok) return tl::unexpected(ok.error());
  if (const auto ok = CheckCurveOrSurface(mesh, "PLY"); !ok) return tl::unexpected(ok.error());
  const bool curve = mesh.dimension() == 1;
  Text text;
  text.Add("ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.points.cols()) +
           "\nproperty double x\nproperty double y\nproperty double z\nelement " +
           (curve ? "edge " : "face ") + std::to_string(mesh.simplices.cols()) +
           (curve ? "\nproperty int vertex1\nproperty int vertex2"
                  : "\nproperty list uchar int vertex_indices") +
           "\nend_header\n");
  text.AddLines("", InSpace(mesh));
  text.AddLines(curve ? "" : "3 ", OrientedSimplices(mesh.simplices));
  return text.str();
}

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
         "\" NumberOfComponents=\"" + std::to_string(components) + "\"" + more + " format=\"binary\">" +
         Base64(bytes) + "</DataArray>\n";
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
std::string FieldData(const Report& report) {
  std::string xml = "<FieldData>\n" + Field("version", "stellate " STELLATE_VERSION);
  if (report.termination != Termination::kUnknown) {
    const std::uint8_t certified = report.certified() ? 1 : 0;
    xml += Field("UInt8", "certified", &certified, 1) +
           Field("verdict", report.certificate.verdict);
  }
  if (report.epsilon > 0) xml += Field("Float64", "epsilon", &report.epsilon, 1);
  return xml + "</FieldData>\n";
}

Expected<std::string> Vtu(const Mesh& mesh) {
  constexpr std::array<std::uint8_t, 4> kCellTypes = {1, 3, 5,
                                                      10};  // vertex, line, triangle, tetra
  if (mesh.dimension() > 3) {
    return CannotHold("VTU holds simplices of dimension 3 at most, and this mesh has dimension " +
                      std::to_string(mesh.dimension()) + "; save it as .txt");
  }
  const Eigen::Index n = mesh.points.cols(), m = mesh.simplices.cols(),
                     width = mesh.simplices.rows();
  const Eigen::MatrixXd points = InSpace(mesh);
  const Eigen::Matrix<std::int64_t, Eigen::Dynamic, Eigen::Dynamic> connectivity =
      OrientedSimplices(mesh.simplices).cast<std::int64_t>();
  std::vector<std::int64_t> offsets(static_cast<size_t>(m));
  for (size_t i = 0; i < offsets.size(); ++i) {
    offsets[i] = static_cast<std::int64_t>(i + 1) * static_cast<std::int64_t>(width);
  }
  const std::vector<std::uint8_t> types(static_cast<size_t>(m),
                                        kCellTypes[static_cast<size_t>(mesh.dimension())]);
  std::string xml =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n" +
      FieldData(mesh.report) + "<Piece NumberOfPoints=\"" +
      std::to_string(n) + "\" NumberOfCells=\"" + std::to_string(m) + "\">\n<Points>\n" +
      DataArray("Float64", "Points", 3, points.data(), points.size()) + "</Points>\n<Cells>\n" +
      DataArray("Int64", "connectivity", 1, connectivity.data(), connectivity.size()) +
      DataArray("Int64", "offsets", 1, offsets.data(), m) +
      DataArray("UInt8", "types", 1, types.data(), m) + "</Cells>\n";
  if (mesh.ambient_dimension() > 3) {
    xml += "<PointData>\n" +
           DataArray("Float64", "coordinates", mesh.ambient_dimension(), mesh.points.data(),
                     mesh.points.size()) +
           "</PointData>\n";
  }
  return xml + "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

}  // namespace

Expected<void> Mesh::Save(const std::string& path) const {
  struct Format {
    const char* ending;
    Expected<std::string> (*write)(const Mesh&);
  };
  constexpr Format kFormats[] = {
      {".txt", Txt}, {".off", Off}, {".obj", Obj}, {".ply", Ply}, {".vtu", Vtu}};
  const std::string ending = std::filesystem::path(path).extension().string();
  for (const Format& format : kFormats) {
    if (ending != format.ending) continue;
    const Expected<std::string> text = format.write(*this);  // in full before the file is touched
    if (!text) return tl::unexpected(text.error());
    return client::WriteFile(path, *text);
  }
  return Fail(ErrorCode::kFileFailed, "no format is known by the ending '" + ending + "' of " +
                                          path + "; known: .txt .off .obj .ply .vtu");
}

}  // namespace stellate
