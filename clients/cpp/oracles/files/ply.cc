// http://paulbourke.net/dataformats/ply: elements of any kind, in any order; points and faces of
// them are kept.
#include <algorithm>
#include <array>
#include <cmath>

#include "oracles/files/bytes.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "oracles/files/ply_header.h"
#include "oracles/files/soup.h"

namespace stellate::oracles::files {
namespace {

// An element a line.
class TextBody {
 public:
  TextBody(std::string_view bytes, const PlyHeader& header)
      : lines_(bytes, '\0', header.size, header.lines) {}

  void Begin(const PlyElement& element) {
    lines_.Need("one more '" + element.name + "'");
    word_ = 0;
  }
  double Number(PlyType) { return lines_.Number(Next()); }
  std::int64_t Whole(PlyType) { return lines_.Whole(Next()); }
  void Skip(PlyType) { Next(); }
  void Expect(std::uint64_t count, const std::string& what, size_t) const {
    lines_.Expect(count, what, 2);  // a digit, and the line's end
  }
  void ExpectList(std::uint64_t length, PlyType) const {
    const size_t left = lines_.words().size() - word_;
    if (length <= left) return;
    lines_.Refuse("a list is " + std::to_string(length) + " long, and " + std::to_string(left) +
                  " words follow on its line");
  }
  std::string place() const { return lines_.place(); }

 private:
  size_t Next() {
    lines_.NeedWords(word_ + 1, "what is there");
    return word_++;
  }

  Lines lines_;
  size_t word_ = 0;
};

class BinaryBody {
 public:
  BinaryBody(std::string_view bytes, const PlyHeader& header)
      : bytes_(bytes, header.size,
               header.format == PlyFormat::kBigEndian ? std::endian::big : std::endian::little) {}

  void Begin(const PlyElement&) {}
  double Number(PlyType type) {
    const double number = Take<double>(type);
    if (std::isfinite(number)) return number;
    Refuse("byte " + std::to_string(bytes_.at() - SizeOf(type)) + ": a coordinate is not finite");
  }
  std::int64_t Whole(PlyType type) { return Take<std::int64_t>(type); }
  void Skip(PlyType type) { bytes_.Skip(SizeOf(type)); }
  void Expect(std::uint64_t count, const std::string& what, size_t least) const {
    CheckAgainstSize(count, what, least, bytes_.left(), place());
  }
  void ExpectList(std::uint64_t length, PlyType type) const {
    Expect(length, "numbers of a list", SizeOf(type));
  }
  std::string place() const { return bytes_.place(); }

 private:
  template <typename As>
  As Take(PlyType type) {
    switch (type) {
      case PlyType::kInt8:
        return static_cast<As>(bytes_.Take<std::int8_t>());
      case PlyType::kUint8:
        return static_cast<As>(bytes_.Take<std::uint8_t>());
      case PlyType::kInt16:
        return static_cast<As>(bytes_.Take<std::int16_t>());
      case PlyType::kUint16:
        return static_cast<As>(bytes_.Take<std::uint16_t>());
      case PlyType::kInt32:
        return static_cast<As>(bytes_.Take<std::int32_t>());
      case PlyType::kUint32:
        return static_cast<As>(bytes_.Take<std::uint32_t>());
      case PlyType::kFloat32:
        return static_cast<As>(bytes_.Take<float>());
      case PlyType::kFloat64:
        return static_cast<As>(bytes_.Take<double>());
    }
    return {};
  }

  Bytes bytes_;
};

template <typename Body>
size_t ListLength(Body* body, const PlyProperty& list) {
  const std::int64_t length = body->Whole(*list.count);
  if (length < 0) Refuse(body->place() + ": a list is " + std::to_string(length) + " long");
  body->ExpectList(static_cast<std::uint64_t>(length), list.type);
  return static_cast<size_t>(length);
}

template <typename Body>
void Skip(Body* body, const PlyProperty& property) {
  const size_t count = property.count ? ListLength(body, property) : 1;
  for (size_t i = 0; i < count; ++i) body->Skip(property.type);
}

// Which of the properties are x, y and z.
std::array<size_t, 3> Coordinates(const PlyElement& vertex) {
  std::array<size_t, 3> found;
  for (int i = 0; i < 3; ++i) {
    const std::string name(1, static_cast<char>('x' + i));
    size_t& at = found[static_cast<size_t>(i)];
    for (at = 0; at < vertex.properties.size(); ++at) {
      if (vertex.properties[at].name == name && !vertex.properties[at].count) break;
    }
    if (at == vertex.properties.size()) Refuse("its points have no property '" + name + "'");
  }
  return found;
}

template <typename Body>
void ReadPoints(const PlyElement& vertex, Body* body, Soup* soup) {
  const std::array<size_t, 3> coordinates = Coordinates(vertex);
  soup->Reserve(vertex.count);
  for (std::uint64_t i = 0; i < vertex.count; ++i) {
    body->Begin(vertex);
    std::array<double, 3> point{};
    for (size_t p = 0; p < vertex.properties.size(); ++p) {
      const auto coordinate = std::find(coordinates.begin(), coordinates.end(), p);
      if (coordinate == coordinates.end()) {
        Skip(body, vertex.properties[p]);
      } else {
        point[static_cast<size_t>(coordinate - coordinates.begin())] =
            body->Number(vertex.properties[p].type);
      }
    }
    soup->AddPoint(point[0], point[1], point[2]);
  }
}

bool NamesCorners(const PlyProperty& property) {
  return property.count && (property.name == "vertex_indices" || property.name == "vertex_index");
}

template <typename Body>
void ReadFaces(const PlyElement& face, Body* body, Soup* soup) {
  for (const PlyProperty& property : face.properties) {
    if (NamesCorners(property) && !IsWhole(property.type)) {
      Refuse("its faces name points by numbers that are not whole");
    }
  }
  std::vector<std::int64_t> corners;
  for (std::uint64_t i = 0; i < face.count; ++i) {
    body->Begin(face);
    corners.clear();
    for (const PlyProperty& property : face.properties) {
      if (!NamesCorners(property)) {
        Skip(body, property);
        continue;
      }
      const size_t count = ListLength(body, property);
      for (size_t c = 0; c < count; ++c) corners.push_back(body->Whole(property.type));
    }
    soup->AddPolygon(corners, i);
  }
}

template <typename Body>
Soup Read(const PlyHeader& header, Body body) {
  Soup soup("face");
  for (const PlyElement& element : header.elements) {
    if (element.properties.empty()) continue;  // no bytes, however many there are
    size_t least = 0;
    for (const PlyProperty& p : element.properties) least += SizeOf(p.count.value_or(p.type));
    body.Expect(element.count, "of '" + element.name + "'", least);
    if (element.name == "vertex") {
      ReadPoints(element, &body, &soup);
    } else if (element.name == "face") {
      ReadFaces(element, &body, &soup);
    } else {
      for (std::uint64_t i = 0; i < element.count; ++i) {
        body.Begin(element);
        for (const PlyProperty& property : element.properties) Skip(&body, property);
      }
    }
  }
  return soup;
}

Soup Read(std::string_view bytes) {
  const PlyHeader header = ParsePlyHeader(bytes);
  if (header.format == PlyFormat::kText) return Read(header, TextBody(bytes, header));
  return Read(header, BinaryBody(bytes, header));
}

}  // namespace

Triangles ParsePly(std::string_view bytes) { return Read(bytes).Finish(); }

Eigen::MatrixXd ParsePlyPoints(std::string_view bytes) {
  const Soup soup = Read(bytes);
  if (soup.size() == 0) Refuse("it has no points");
  return soup.Points();
}

}  // namespace stellate::oracles::files
