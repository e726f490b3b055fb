// numpy's archives, and in them its arrays, of format 1.0: all that a mesh is, exact.
#include <utf8.h>

#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "mesh/formats.h"
#include "mesh/zip.h"

namespace stellate::client {
namespace {

// `type`, `shape`: as numpy says them, "<f8" and "(5, 3)".
void AddArray(Zip* zip, const std::string& name, const std::string& type, const std::string& shape,
              std::string_view data) {
  std::string head = "{'descr': '" + type + "', 'fortran_order': False, 'shape': " + shape + ", }";
  constexpr std::size_t kBefore = 10, kMultiple = 64;
  while ((kBefore + head.size() + 1) % kMultiple != 0) head += ' ';
  head += '\n';
  const auto size = static_cast<std::uint16_t>(head.size());
  std::string bytes("\x93NUMPY\1\0", 8);
  bytes.append(reinterpret_cast<const char*>(&size), sizeof size);
  bytes += head;
  bytes += data;
  zip->Add(name + ".npy", bytes);
}

std::string Shape(Eigen::Index count) { return "(" + std::to_string(count) + ",)"; }
std::string Shape(Eigen::Index rows, Eigen::Index columns) {
  return "(" + std::to_string(rows) + ", " + std::to_string(columns) + ")";
}

template <typename Number>
std::string_view BytesOf(const Number* data, std::size_t count) {
  return {reinterpret_cast<const char*>(data), count * sizeof(Number)};
}

// numpy's strings are all as long as the longest, in 32 bits a character.
void AddStrings(Zip* zip, const std::string& name, const std::string& shape,
                const std::vector<std::string>& values) {
  std::vector<std::u32string> wide;
  std::size_t width = 1;
  for (const std::string& value : values) {
    std::string valid;
    utf8::replace_invalid(value.begin(), value.end(), std::back_inserter(valid));
    utf8::utf8to32(valid.begin(), valid.end(), std::back_inserter(wide.emplace_back()));
    width = std::max(width, wide.back().size());
  }
  std::string data;
  for (std::u32string& value : wide) {
    value.resize(width, U'\0');
    data += BytesOf(value.data(), width);
  }
  AddArray(zip, name, "<U" + std::to_string(width), shape, data);
}

}  // namespace

Expected<std::string> Npz(const Mesh& mesh) {
  Zip zip;
  const Eigen::Index m = mesh.simplices.cols();
  AddArray(&zip, "points", "<f8", Shape(mesh.points.cols(), mesh.points.rows()),
           BytesOf(mesh.points.data(), static_cast<std::size_t>(mesh.points.size())));
  const Eigen::Matrix<std::int64_t, Eigen::Dynamic, Eigen::Dynamic> ids =
      mesh.simplices.cast<std::int64_t>();
  AddArray(&zip, "simplices", "<i8", Shape(m, ids.rows()),
           BytesOf(ids.data(), static_cast<std::size_t>(ids.size())));
  if (!mesh.walls.empty()) {
    AddArray(&zip, "walls", "<u8", Shape(std::ssize(mesh.walls)),
             BytesOf(mesh.walls.data(), mesh.walls.size()));
  }
  // Of a boundary alone the two of each simplex, as Python's Mesh has them.
  if (mesh.is_boundary()) {
    AddArray(&zip, "labels", "|i1", Shape(m, 2), BytesOf(mesh.sides.data(), mesh.sides.size()));
  } else if (!mesh.labels.empty()) {
    AddArray(&zip, "labels", "|i1", Shape(m), BytesOf(mesh.labels.data(), mesh.labels.size()));
  }
  if (!mesh.region_names.empty())
    AddStrings(&zip, "region_names", Shape(std::ssize(mesh.region_names)), mesh.region_names);
  if (mesh.report.termination != Termination::kUnknown) {
    const std::uint8_t certified = mesh.report.certified() ? 1 : 0;
    AddArray(&zip, "certified", "|b1", "()", BytesOf(&certified, 1));
    AddStrings(&zip, "verdict", "()", {mesh.report.certificate.verdict});
    AddArray(&zip, "epsilon", "<f8", "()", BytesOf(&mesh.report.epsilon, 1));
  }
  return zip.Finish();
}

}  // namespace stellate::client
