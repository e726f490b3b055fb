// Wavefront's format: points and faces of it; normals, textures, groups, curves are skipped.
#include <charconv>

#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "oracles/files/soup.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

// "7", "7/1/2", "7//2", or "-1", the last point so far; from 0.
std::int64_t Corner(const Lines& lines, std::string_view word, std::int64_t points) {
  const std::string_view name = word.substr(0, word.find('/'));
  std::int64_t number = 0;
  const auto [end, status] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (end != name.data() + name.size() || status != std::errc() || number == 0) {
    lines.Refuse(pipe::Quoted(word) + " names no point; the first is 1, the last one so far -1");
  }
  if (number < -points) {
    lines.Refuse(pipe::Quoted(word) + " names a point before the first: there are " +
                 std::to_string(points) + " above");
  }
  return number < 0 ? points + number : number - 1;
}

}  // namespace

Triangles ParseObj(std::string_view bytes) {
  Lines lines(bytes, '#');
  Soup soup("line");
  std::vector<std::int64_t> corners;
  while (lines.Next()) {
    const std::vector<std::string_view>& words = lines.words();
    if (words[0] == "v") {
      lines.NeedWords(4, "a point");
      soup.AddPoint(lines.Number(1), lines.Number(2), lines.Number(3));
    } else if (words[0] == "f") {
      corners.clear();
      for (size_t i = 1; i < words.size(); ++i) {
        corners.push_back(Corner(lines, words[i], soup.size()));
      }
      soup.AddPolygon(corners, lines.number());
    }
  }
  return soup.Finish();
}

}  // namespace stellate::oracles::files
