#include "mesh/formats.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <vector>

#include "mesh/groups.h"
#include "mesh/surface.h"

namespace stellate::client {
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

}  // namespace

Eigen::MatrixXd InSpace(const Mesh& mesh) {
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(3, mesh.points.cols());
  const Eigen::Index rows = std::min<Eigen::Index>(3, mesh.points.rows());
  points.topRows(rows) = mesh.points.topRows(rows);
  return points;
}

std::string Txt(const Mesh& mesh) {
  Text text;
  text.Add(std::to_string(mesh.dimension()) + " " + std::to_string(mesh.ambient_dimension()) + " " +
           std::to_string(mesh.points.cols()) + " " + std::to_string(mesh.simplices.cols()) + "\n");
  text.AddLines("", mesh.points);
  text.AddLines("", mesh.simplices);
  return text.str();
}

std::string Off(const Mesh& mesh) {
  Text text;
  text.Add(mesh.ambient_dimension() == 3
               ? "OFF\n"
               : "nOFF\n" + std::to_string(mesh.ambient_dimension()) + "\n");
  const Drawn drawn =
      mesh.dimension() == 3 ? DrawnOf(mesh) : Drawn{mesh.points, OrientedSimplices(mesh)};
  text.Add(std::to_string(drawn.points.cols()) + " " + std::to_string(drawn.simplices.cols()) +
           " 0\n");
  text.AddLines("", drawn.points);
  text.AddLines(std::to_string(drawn.simplices.rows()) + " ", drawn.simplices);
  return text.str();
}

std::string Obj(const Mesh& mesh) {
  constexpr const char* kPrefixes[] = {"p ", "l ", "f "};
  Text text;
  text.AddLines("v ", InSpace(mesh));
  const std::vector<Group> groups = GroupsOf(mesh);
  if (mesh.dimension() == 3 && groups.size() == 1) {  // it is not known on what walls it ends
    const SimplexMatrix surface = BoundaryOf(OrientedSimplices(mesh));
    text.AddLines("f ", SimplexMatrix(surface.array() + 1));
  }
  for (const Group& group : groups) {
    if (group.dimension() == 3) continue;  // a solid is its boundary here
    if (groups.size() > 1) text.Add("g " + group.name + "\n");
    text.AddLines(kPrefixes[group.dimension()], SimplexMatrix(group.simplices.array() + 1));
  }
  return text.str();
}

std::string Ply(const Mesh& mesh) {
  const bool curve = mesh.dimension() == 1;
  const Drawn drawn = DrawnOf(mesh);
  Text text;
  text.Add("ply\nformat ascii 1.0\nelement vertex " + std::to_string(drawn.points.cols()) +
           "\nproperty double x\nproperty double y\nproperty double z\nelement " +
           (curve ? "edge " : "face ") + std::to_string(drawn.simplices.cols()) +
           (curve ? "\nproperty int vertex1\nproperty int vertex2"
                  : "\nproperty list uchar int vertex_indices") +
           "\nend_header\n");
  text.AddLines("", drawn.points);
  text.AddLines(curve ? "" : "3 ", drawn.simplices);
  return text.str();
}

std::string Msh(const Mesh& mesh) {
  constexpr int kElementTypes[] = {15, 1, 2, 4};  // point, line, triangle, tetrahedron
  const Eigen::MatrixXd points = InSpace(mesh);
  const std::vector<Group> groups = GroupsOf(mesh);
  Text text;
  text.Add("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n");
  if (groups.size() > 1) {
    text.Add("$PhysicalNames\n" + std::to_string(groups.size()) + "\n");
    for (const Group& group : groups) {
      text.Add(std::to_string(group.dimension()) + " " + std::to_string(group.tag) + " \"" +
               group.name + "\"\n");
    }
    text.Add("$EndPhysicalNames\n");
  }
  text.Add("$Nodes\n" + std::to_string(points.cols()) + "\n");
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    text.Add(std::to_string(j + 1) + " ");
    text.AddLines("", points.col(j));
  }
  text.Add("$EndNodes\n$Elements\n" + std::to_string(CountSimplices(groups)) + "\n");
  Eigen::Index number = 0;
  for (const Group& group : groups) {
    // Two tags for each element: its physical group and its geometrical entity, by the same number.
    char type[64];
    std::snprintf(type, sizeof type, " %d 2 %d %d ", kElementTypes[group.dimension()], group.tag,
                  group.tag);
    const SimplexMatrix simplices = group.simplices.array() + 1;
    for (Eigen::Index j = 0; j < simplices.cols(); ++j) {
      text.AddLines(std::to_string(++number) + type, simplices.col(j));
    }
  }
  text.Add("$EndElements\n");
  return text.str();
}

Expected<std::string> Stl(const Mesh& mesh) {
  const auto [points, triangles] = DrawnOf(mesh);
  std::string bytes(80, ' ');  // a header that says nothing, and never "solid"
  const auto add = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(static_cast<std::uint32_t>(triangles.cols()));
  for (Eigen::Index j = 0; j < triangles.cols(); ++j) {
    Eigen::Matrix3d corners;
    for (Eigen::Index i = 0; i < 3; ++i) corners.col(i) = points.col(triangles(i, j));
    const Eigen::Matrix3f single = corners.cast<float>();
    if (single.col(0) == single.col(1) || single.col(1) == single.col(2) ||
        single.col(2) == single.col(0)) {
      return Fail(ErrorCode::kFileFailed,
                  "STL has single precision, in which vertices of this mesh fall together: save it "
                  "as .ply, or move it nearer to the origin");
    }
    const Eigen::Vector3d normal =
        (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
    const Eigen::Vector3f rounded = normal.cast<float>();
    bytes.append(reinterpret_cast<const char*>(rounded.data()), sizeof(float) * 3);
    bytes.append(reinterpret_cast<const char*>(single.data()), sizeof(float) * 9);
    add(std::uint16_t{0});
  }
  return bytes;
}

}  // namespace stellate::client
