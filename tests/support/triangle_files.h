#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace stellate::testing {

struct TriangleFile {
  std::string ending;  // ".off"
  std::string bytes;
};

template <typename Number>
void AppendRaw(Number number, bool reversed, std::string* to) {
  std::string raw(reinterpret_cast<const char*>(&number), sizeof number);
  if (reversed) std::reverse(raw.begin(), raw.end());
  *to += raw;
}

// One tetrahedron, (1 1 1) (1 -1 -1) (-1 1 -1) (-1 -1 0.125) with faces 012 013 023 123, in every
// format that is read, and with all that may stand beside it.
inline std::vector<TriangleFile> TetrahedronFiles() {
  const float points[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 0.125}};
  const int faces[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
  const std::string ply_elements =
      "comment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nproperty list uchar short near\nelement note 1\nproperty double value\n"
      "element face 4\nproperty uchar red\nproperty list uchar int vertex_indices\nend_header\n";
  std::string stl = "solid a\n", binary_stl("solid, and binary");
  binary_stl.resize(80, ' ');
  AppendRaw<std::uint32_t>(4, false, &binary_stl);
  for (const auto& face : faces) {
    stl += "facet normal nan nan nan\n outer loop\n";
    for (int i = 0; i < 3; ++i) AppendRaw(0.0F, false, &binary_stl);
    for (const int corner : face) {
      stl += "  vertex";
      for (const float x : points[corner]) {
        stl += " " + std::to_string(x);
        AppendRaw(x, false, &binary_stl);
      }
      stl += "\n";
    }
    stl += " endloop\nendfacet\n";
    binary_stl += "\1\2";
  }
  std::vector<TriangleFile> files = {
      {".off",
       "OFF # a comment\n4 4 6\n\n1 1 1\n1 -1 -1\n-1 +1 -1\n-1 -1 1.25e-1\n3 0 1 2\n3 0 1 3 255 0 "
       "0\n"
       "3 0 2 3\n3 1 2 3"},
      {".off",
       "COFF4 4 0\n1 1 1 9 9 9 9\n1 -1 -1 9 9 9 9\n-1 1 -1 9 9 9 9\n-1 -1 .125 9 9 9 9\n"
       "3 0 1 2\n3 0 1 3\n3 0 2 3\n3 1 2 3\n2 0 1\n"},
      {".obj",
       "mtllib none\nv 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 0.125 1\nvt 0 0\nvn 0 0 1\nf 1 2 3\r\n"
       "f 1/1 2/1 4/1\nf 1//1 3//1 4//1\nf -3/1/1 -2/1/1 -1/1/1\n"},
      {".stl", stl + "endsolid a\n"},
      {".stl", binary_stl},
      {".ply", "ply\nformat ascii 1.0\n" + ply_elements +
                   "1 1 1 0\n1 -1 -1 1 7\n-1 1 -1 0\n-1 -1 0.125 2 5 6\nnan\n9 3 0 1 2\n9 3 0 1 3\n"
                   "9 3 0 2 3\n9 3 1 2 3\n"}};
  for (const bool big : {false, true}) {
    std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                        "_endian 1.0\n" + ply_elements;
    for (const auto& point : points) {
      for (const float x : point) AppendRaw(x, big, &bytes);
      bytes += '\1';
      AppendRaw<std::int16_t>(-3, big, &bytes);
    }
    AppendRaw(0.5, big, &bytes);
    for (const auto& face : faces) {
      bytes += "\1\3";
      for (const int corner : face) AppendRaw(corner, big, &bytes);
    }
    files.push_back({".ply", bytes});
  }
  return files;
}

}  // namespace stellate::testing
