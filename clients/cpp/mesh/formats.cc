#include "mesh/formats.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <string_view>
#include <utility>

#include "mesh/parts.h"
#include "mesh/surface.h"

namespace stellate::client {
namespace {

constexpr std::size_t kBlockBytes = std::size_t{1} << 20;  // written at a time

class TextWriter final : public MeshWriter {
 public:
  TextWriter(Draft draft, TextLayout layout)
      : draft_(std::move(draft)), layout_(std::move(layout)), text_(layout_.head) {}

  Expected<void> AddPoints(const Eigen::Ref<const Eigen::MatrixXd>& points) override {
    constexpr Eigen::Index kRows = 4096;
    for (Eigen::Index first = 0; first < points.cols(); first += kRows) {
      const auto some = points.middleCols(first, std::min(kRows, points.cols() - first));
      auto ok = layout_.in_space ? AddLines(layout_.point_prefix, InSpace(some))
                                 : AddLines(layout_.point_prefix, some);
      if (!ok) return ok;
    }
    return {};
  }

  Expected<void> AddCells(std::size_t group,
                          const Eigen::Ref<const SimplexMatrix>& cells) override {
    BeginCells();
    for (; begun_ <= group; ++begun_) text_ += layout_.groups[begun_].before;
    return AddLines(layout_.groups[group].prefix, cells);
  }

  Expected<void> Finish() override {
    BeginCells();
    text_ += layout_.end;
    if (auto ok = draft_.Write(text_); !ok) return ok;
    return draft_.Finish();
  }

 private:
  void BeginCells() {
    if (std::exchange(in_cells_, true)) return;
    text_ += layout_.middle;
    line_ = 0;
  }

  // As printf's %.17g writes it in the C locale.
  void Add(double value) {
    std::array<char, 32> number;
    const auto end = std::to_chars(number.data(), number.data() + number.size(), value,
                                   std::chars_format::general, 17);
    text_.append(number.data(), end.ptr);
  }
  void Add(std::uint32_t id) {
    text_ += std::to_string(std::uint64_t{id} + static_cast<std::uint64_t>(layout_.first_id));
  }

  template <typename Matrix>
  Expected<void> AddLines(std::string_view prefix, const Matrix& columns) {
    for (Eigen::Index j = 0; j < columns.cols(); ++j) {
      if (layout_.numbered) text_ += std::to_string(++line_);
      text_ += prefix;
      for (Eigen::Index i = 0; i < columns.rows(); ++i) {
        if (i > 0) text_ += ' ';
        Add(columns(i, j));
      }
      text_ += '\n';
      if (text_.size() < kBlockBytes) continue;
      if (auto ok = draft_.Write(text_); !ok) return ok;
      text_.clear();
    }
    return {};
  }

  Draft draft_;
  TextLayout layout_;
  std::string text_;  // not yet written
  bool in_cells_ = false;
  std::size_t begun_ = 0;   // groups
  std::uint64_t line_ = 0;  // numbered so far
};

}  // namespace

std::uint64_t FileShape::simplices() const {
  std::uint64_t count = 0;
  for (const Cells& cells : groups) count += cells.count;
  return count;
}

std::unique_ptr<MeshWriter> MakeTextWriter(Draft draft, TextLayout layout) {
  return std::make_unique<TextWriter>(std::move(draft), std::move(layout));
}

Eigen::MatrixXd InSpace(const Eigen::Ref<const Eigen::MatrixXd>& points) {
  Eigen::MatrixXd space = Eigen::MatrixXd::Zero(3, points.cols());
  const Eigen::Index rows = std::min<Eigen::Index>(3, points.rows());
  space.topRows(rows) = points.topRows(rows);
  return space;
}

TextLayout Txt(const FileShape& shape) {
  return {.head = std::to_string(shape.dimension) + " " + std::to_string(shape.ambient_dimension) +
                  " " + std::to_string(shape.vertices) + " " + std::to_string(shape.simplices()) +
                  "\n",
          .groups = {{}}};
}

TextLayout Off(const FileShape& shape) {
  const int d = shape.ambient_dimension;
  return {.head = (d == 3 ? "OFF\n" : "nOFF\n" + std::to_string(d) + "\n") +
                  std::to_string(shape.vertices) + " " + std::to_string(shape.simplices()) + " 0\n",
          .groups = {{"", std::to_string(shape.groups[0].dimension + 1) + " "}}};
}

TextLayout Obj(const FileShape& shape) {
  constexpr const char* kPrefixes[] = {"p ", "l ", "f "};
  TextLayout layout{.head = "", .point_prefix = "v ", .in_space = true, .first_id = 1};
  for (const FileShape::Cells& cells : shape.groups) {
    layout.groups.push_back(
        {cells.name.empty() ? "" : "g " + cells.name + "\n", kPrefixes[cells.dimension]});
  }
  return layout;
}

TextLayout Msh(const FileShape& shape) {
  constexpr int kElementTypes[] = {15, 1, 2, 4};  // point, line, triangle, tetrahedron
  TextLayout layout{.head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
                    .middle = "$EndNodes\n$Elements\n" + std::to_string(shape.simplices()) + "\n",
                    .end = "$EndElements\n",
                    .point_prefix = " ",
                    .in_space = true,
                    .numbered = true,
                    .first_id = 1};
  if (shape.groups.size() > 1) {
    layout.head += "$PhysicalNames\n" + std::to_string(shape.groups.size()) + "\n";
    for (const FileShape::Cells& cells : shape.groups) {
      layout.head += std::to_string(cells.dimension) + " " + std::to_string(cells.tag) + " \"" +
                     cells.name + "\"\n";
    }
    layout.head += "$EndPhysicalNames\n";
  }
  layout.head += "$Nodes\n" + std::to_string(shape.vertices) + "\n";
  for (const FileShape::Cells& cells : shape.groups) {
    // Two tags for each element: its physical group and its geometrical entity, by the same number.
    const std::string tag = std::to_string(cells.tag) + " ";
    std::string middle = " " + std::to_string(kElementTypes[cells.dimension]) + " 2 ";
    middle.append(tag).append(tag);
    layout.groups.push_back({"", std::move(middle)});
  }
  return layout;
}

Expected<std::string> Stl(const Mesh& mesh) {
  const auto [points, triangles] = DrawnOf(mesh);
  if (auto ok = CheckSinglePrecision(points, triangles, "STL"); !ok)
    return tl::unexpected(ok.error());
  std::string bytes(80, ' ');  // a header that says nothing, and never "solid"
  const auto add = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(static_cast<std::uint32_t>(triangles.cols()));
  for (Eigen::Index j = 0; j < triangles.cols(); ++j) {
    Eigen::Matrix3d corners;
    for (Eigen::Index i = 0; i < 3; ++i) corners.col(i) = points.col(triangles(i, j));
    const Eigen::Matrix3f single = corners.cast<float>();
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
