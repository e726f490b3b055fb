// A triangle has its own three corners here: equal ones are made one.
#include <array>
#include <cmath>
#include <map>

#include "oracles/files/bytes.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "oracles/files/soup.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

constexpr size_t kHeader = 80, kTriangle = 50;  // bytes: a normal, three corners, two of attributes

class Corners {
 public:
  explicit Corners(std::string places) : soup_(std::move(places)) {}

  void Add(const std::array<double, 3>& point) {
    const auto [known, is_new] = names_.emplace(point, soup_.size());
    if (is_new) soup_.AddPoint(point[0], point[1], point[2]);
    triangle_.push_back(known->second);
  }
  size_t count() const { return triangle_.size(); }
  void EndTriangle(size_t place) {
    soup_.AddPolygon(triangle_, place);
    triangle_.clear();
  }
  Triangles Finish() const { return soup_.Finish(); }

 private:
  Soup soup_;
  std::map<std::array<double, 3>, std::int64_t> names_;  // -0 is 0
  std::vector<std::int64_t> triangle_;
};

Triangles ParseBinary(std::string_view bytes) {
  Bytes reader(bytes, kHeader, std::endian::little);
  const auto triangles = reader.Take<std::uint32_t>();
  Corners corners("triangle");
  for (std::uint32_t i = 0; i < triangles; ++i) {
    reader.Skip(3 * sizeof(float));
    for (int corner = 0; corner < 3; ++corner) {
      std::array<double, 3> point;
      for (double& coordinate : point) coordinate = reader.Take<float>();
      for (const double coordinate : point) {
        if (!std::isfinite(coordinate)) {
          Refuse("byte " + std::to_string(reader.at() - 3 * sizeof(float)) +
                 ": a corner of triangle " + std::to_string(i) + " is not finite");
        }
      }
      corners.Add(point);
    }
    reader.Skip(kTriangle - 12 * sizeof(float));
    corners.EndTriangle(i);
  }
  return corners.Finish();
}

bool Is(std::string_view word, std::string_view keyword) {
  const auto same = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a + 32 : a) == b; };
  return std::equal(word.begin(), word.end(), keyword.begin(), keyword.end(), same);
}

Triangles ParseText(std::string_view bytes) {
  Lines lines(bytes, '\0');
  Corners corners("line");
  bool open = false;
  while (lines.Next()) {
    const std::string_view word = lines.words()[0];
    if (Is(word, "vertex")) {
      lines.NeedWords(4, "a corner");
      corners.Add({lines.Number(1), lines.Number(2), lines.Number(3)});
    } else if (Is(word, "endloop")) {
      if (corners.count() != 3) {
        lines.Refuse("a triangle has " + std::to_string(corners.count()) + " corners");
      }
      corners.EndTriangle(lines.number());
    } else if (Is(word, "solid") || Is(word, "endsolid")) {
      open = Is(word, "solid");
    } else if (!Is(word, "facet") && !Is(word, "outer") && !Is(word, "endfacet")) {
      lines.Refuse(pipe::Quoted(word) + " is no word of STL");
    }
  }
  if (open || corners.count() != 0) {
    lines.Refuse("the file ends before 'endsolid': is it cut short?");
  }
  return corners.Finish();
}

}  // namespace

Triangles ParseStl(std::string_view bytes) {
  // Binary files may begin with "solid", too: their length tells.
  if (bytes.size() >= kHeader + 4) {
    const auto triangles = Bytes(bytes, kHeader, std::endian::little).Take<std::uint32_t>();
    if ((bytes.size() - kHeader - 4) / kTriangle == triangles &&
        (bytes.size() - kHeader - 4) % kTriangle == 0) {
      return ParseBinary(bytes);
    }
  }
  Lines lines(bytes, '\0');
  if (lines.Next() && Is(lines.words()[0], "solid")) return ParseText(bytes);
  if (bytes.size() < kHeader + 4) {
    Refuse("it has " + std::to_string(bytes.size()) +
           " bytes, begins without 'solid', and a binary STL has 84 at least: is it cut short?");
  }
  const auto triangles = Bytes(bytes, kHeader, std::endian::little).Take<std::uint32_t>();
  Refuse("byte 80: says that " + std::to_string(triangles) +
         " triangles follow, of 50 bytes each, and " + std::to_string(bytes.size() - kHeader - 4) +
         " bytes do: is the file cut short?");
}

}  // namespace stellate::oracles::files
