#include "oracles/files/ply_header.h"

#include <algorithm>
#include <array>

#include "oracles/files/lines.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

struct Name {
  const char *word, *other;
  PlyType type;
  size_t size;
};
constexpr Name kTypes[] = {
    {"char", "int8", PlyType::kInt8, 1},        {"uchar", "uint8", PlyType::kUint8, 1},
    {"short", "int16", PlyType::kInt16, 2},     {"ushort", "uint16", PlyType::kUint16, 2},
    {"int", "int32", PlyType::kInt32, 4},       {"uint", "uint32", PlyType::kUint32, 4},
    {"float", "float32", PlyType::kFloat32, 4}, {"double", "float64", PlyType::kFloat64, 8},
};

PlyType ParseType(const Lines& lines, std::string_view word) {
  for (const Name& name : kTypes) {
    if (word == name.word || word == name.other) return name.type;
  }
  lines.Refuse(pipe::Quoted(word) + " is no type of PLY, such as float or int32");
}

template <typename Named>
void RefuseTwice(const Lines& lines, const std::vector<Named>& known, std::string_view name) {
  const auto same = [name](const Named& one) { return one.name == name; };
  if (std::any_of(known.begin(), known.end(), same)) {
    lines.Refuse("the name " + pipe::Quoted(name) + " is there twice");
  }
}

PlyFormat ParseFormat(const Lines& lines) {
  const auto& words = lines.words();
  if (words[0] != "format" || words.size() < 2) {
    lines.Refuse("the second line of a PLY says its format, as 'format ascii 1.0'");
  }
  if (words[1] == "ascii") return PlyFormat::kText;
  if (words[1] == "binary_little_endian") return PlyFormat::kLittleEndian;
  if (words[1] == "binary_big_endian") return PlyFormat::kBigEndian;
  lines.Refuse(pipe::Quoted(words[1]) +
               " is none of ascii, binary_little_endian and binary_big_endian");
}

void AddElement(const Lines& lines, std::vector<PlyElement>* elements) {
  lines.NeedWords(3, "an element");
  RefuseTwice(lines, *elements, lines.words()[1]);
  elements->push_back(
      {std::string(lines.words()[1]), lines.Count(lines.words()[2], "elements"), {}});
}

void AddProperty(const Lines& lines, std::vector<PlyElement>* elements) {
  if (elements->empty()) lines.Refuse("a property comes before any element");
  const auto& words = lines.words();
  std::vector<PlyProperty>& properties = elements->back().properties;
  const bool is_list = words.size() > 1 && words[1] == "list";
  lines.NeedWords(is_list ? 5 : 3, "a property");
  RefuseTwice(lines, properties, words[is_list ? 4 : 2]);
  PlyProperty property{
      std::string(words[is_list ? 4 : 2]), ParseType(lines, words[is_list ? 3 : 1]), {}};
  if (is_list) {
    property.count = ParseType(lines, words[2]);
    if (!IsWhole(*property.count)) lines.Refuse("the length of a list has to be a whole number");
  }
  properties.push_back(std::move(property));
}

}  // namespace

size_t SizeOf(PlyType type) { return kTypes[static_cast<size_t>(type)].size; }

PlyHeader ParsePlyHeader(std::string_view bytes) {
  Lines lines(bytes, '\0');
  lines.Need("the word 'ply'");
  if (lines.words()[0] != "ply") lines.Refuse("a PLY begins with 'ply'");
  lines.Need("the format");
  PlyHeader header{ParseFormat(lines), {}, 0, 0};
  while (true) {
    lines.Need("'end_header'");
    const std::string_view word = lines.words()[0];
    if (word == "end_header") break;
    if (word == "element") {
      AddElement(lines, &header.elements);
    } else if (word == "property") {
      AddProperty(lines, &header.elements);
    } else if (word != "comment" && word != "obj_info") {
      lines.Refuse(pipe::Quoted(word) + " is no word of a PLY's header");
    }
  }
  header.size = lines.offset();
  header.lines = lines.number();
  return header;
}

}  // namespace stellate::oracles::files
