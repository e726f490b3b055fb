#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <new>
#include <utility>
#include <vector>

#include "oracles/combined/common.h"
#include "oracles/files/contents.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "pipe/numbers.h"

namespace stellate::oracles {
namespace files {

Eigen::MatrixXd ParsePointText(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  Lines lines(text, '#');
  std::vector<double> numbers;
  size_t width = 0, first = 0;
  const auto is_number = [](std::string_view word) {
    double ignored = 0;
    return pipe::ParseNumber(word, &ignored);
  };
  bool is_first = true;
  while (lines.Next()) {
    const auto& words = lines.words();
    // What the columns are called.
    const bool is_header =
        std::exchange(is_first, false) && std::none_of(words.begin(), words.end(), is_number);
    if (is_header) continue;
    if (width == 0) {
      width = words.size();
      first = lines.number();
    }
    if (words.size() != width) {
      lines.Refuse("has " + std::to_string(words.size()) + " numbers, and line " +
                   std::to_string(first) + " has " + std::to_string(width));
    }
    for (size_t word = 0; word < width; ++word) numbers.push_back(lines.Number(word));
  }
  if (width == 0) Refuse("it has no points");
  return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), static_cast<Eigen::Index>(width),
                                           std::ssize(numbers) / static_cast<Eigen::Index>(width));
}

}  // namespace files
namespace {

Eigen::MatrixXd Parse(const std::filesystem::path& path) {
  if (path == "-") return files::ParsePointText({std::istreambuf_iterator<char>(std::cin), {}});
  const std::string ending = files::EndingOf(path);
  if (ending == ".npy") return files::ParseNpy(files::Contents(path));
  if (ending == ".ply") return files::ParsePlyPoints(files::Contents(path));
  for (const char* text : {".xyz", ".csv", ".txt"}) {
    if (ending == text) return files::ParsePointText(files::Contents(path));
  }
  Refuse("files of points that are read end in .ply, .npy, .csv, .xyz or .txt");
}

}  // namespace

Eigen::MatrixXd ReadPoints(const std::string& path, std::optional<int> coordinates) {
  const std::string begin =
      (path == "-" ? "standard input" : "'" + path + "'") + " cannot be read as points: ";
  try {
    Eigen::MatrixXd points = Parse(path);
    const int d = coordinates.value_or(static_cast<int>(points.rows()));
    if (d < 1 || d > points.rows()) {
      Refuse("a point has " + std::to_string(points.rows()) + " coordinates, and " +
             std::to_string(d) + " are asked for");
    }
    if (d < points.rows()) points = points.topRows(d).eval();
    return points;
  } catch (const std::invalid_argument& e) {
    Refuse(begin + e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    Refuse(begin + e.what());
  } catch (const std::bad_alloc&) {
    Refuse(begin + "it is too large for the memory that is left");
  }
}

}  // namespace stellate::oracles
