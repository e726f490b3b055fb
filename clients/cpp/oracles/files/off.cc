// https://people.sc.fsu.edu/~jburkardt/data/off/off.html, and Geomview's manual.
#include <array>

#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "oracles/files/soup.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

// Of a point's line, what it has beside coordinates: texture, colour, normal.
bool IsPrefix(std::string_view text) {
  for (const std::string_view known : {"ST", "C", "N"}) {
    if (text.starts_with(known)) text.remove_prefix(known.size());
  }
  return text.empty();
}

// How many points and faces there are: after the keyword, or on a line of their own.
std::array<std::uint64_t, 2> ReadCounts(Lines* lines) {
  lines->Need("the word OFF");
  std::vector<std::string_view> words = lines->words();
  const size_t keyword = words[0].find("OFF");
  if (keyword == std::string_view::npos || !IsPrefix(words[0].substr(0, keyword))) {
    lines->Refuse("begins with " + pipe::Quoted(words[0]) +
                  ", and a surface in R^3 with OFF, COFF, NOFF or STOFF");
  }
  if (words.size() > 1 && words[1] == "BINARY") {
    lines->Refuse("binary OFF is not read: write it as text, or as .ply");
  }
  words[0].remove_prefix(keyword + 3);  // "OFF8 12 0" is what some well-known files begin with
  if (words[0].empty()) words.erase(words.begin());
  if (words.empty()) {
    lines->Need("how many points and faces there are");
    words = lines->words();
  }
  if (words.size() < 2) lines->Refuse("has to say how many points and how many faces there are");
  return {lines->Count(words[0], "points"), lines->Count(words[1], "faces")};
}

}  // namespace

Triangles ParseOff(std::string_view bytes) {
  Lines lines(bytes, '#');
  const auto [points, faces] = ReadCounts(&lines);
  constexpr size_t kPoint = 6, kFace = 2;  // "0 0 0" and "0", with the line's end
  lines.Expect(points, "points", kPoint);
  lines.Expect(faces, "faces", kFace);
  Soup soup("line");
  soup.Reserve(points);
  for (std::uint64_t i = 0; i < points; ++i) {
    lines.Need("point " + std::to_string(i + 1) + " of " + std::to_string(points));
    lines.NeedWords(3, "a point");
    soup.AddPoint(lines.Number(0), lines.Number(1), lines.Number(2));
  }
  std::vector<std::int64_t> corners;
  for (std::uint64_t i = 0; i < faces; ++i) {
    lines.Need("face " + std::to_string(i + 1) + " of " + std::to_string(faces));
    const std::uint64_t count = lines.Count(lines.words()[0], "corners");
    if (count >= lines.words().size()) {
      lines.Refuse("a face of " + std::to_string(count) + " corners names " +
                   std::to_string(lines.words().size() - 1));
    }
    corners.clear();
    for (size_t word = 1; word <= count; ++word) corners.push_back(lines.Whole(word));
    soup.AddPolygon(corners, lines.number());
  }
  return soup.Finish();
}

}  // namespace stellate::oracles::files
