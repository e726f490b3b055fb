#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stellate::oracles::files {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

size_t SizeOf(PlyType type);  // bytes
inline bool IsWhole(PlyType type) { return type < PlyType::kFloat32; }

struct PlyProperty {
  std::string name;
  PlyType type;
  std::optional<PlyType> count;  // of a list: the type of its length
};

struct PlyElement {
  std::string name;
  std::uint64_t count;
  std::vector<PlyProperty> properties;
};

enum class PlyFormat { kText, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyFormat format;
  std::vector<PlyElement> elements;  // no name twice, neither of them nor within one
  size_t size;                       // bytes, until the body begins
  size_t lines;
};

// Throws std::invalid_argument, with the line.
PlyHeader ParsePlyHeader(std::string_view bytes);

}  // namespace stellate::oracles::files
