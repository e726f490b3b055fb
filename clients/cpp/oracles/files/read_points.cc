#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include "oracles/combined/common.h"
#include "oracles/files/columns.h"
#include "oracles/files/contents.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "pipe/numbers.h"

namespace stellate::oracles {
namespace files {
namespace {

// Among them x, y and z, and others, which may be times, colours or labels.
bool HasOthersThanXyz(const std::vector<std::string_view>& titles) {
  const auto is_titled = [&](char name) {
    return std::any_of(titles.begin(), titles.end(), [name](std::string_view title) {
      title = Unquoted(title);
      return title.size() == 1 && (title[0] | 0x20) == name;
    });
  };
  return titles.size() > 3 && is_titled('x') && is_titled('y') && is_titled('z');
}

// A comma between digits, where other numbers on the line are apart by blanks alone.
bool HasDecimalComma(const std::vector<std::string_view>& words) {
  bool has = false;
  for (const std::string_view word : words) {
    const size_t comma = word.find(',');
    if (comma == std::string_view::npos) continue;
    const std::string_view whole = word.substr(0, comma), share = word.substr(comma + 1);
    double ignored = 0;
    if (!pipe::ParseNumber(whole, &ignored) || !pipe::ParseNumber(share, &ignored)) return false;
    has = true;
  }
  return has && words.size() > 1;
}

// Commas are between numbers: with those inside of them a file has twice the columns.
void RefuseDecimalCommas(std::string_view text) {
  Lines lines(text, '#');
  for (int line = 0; line < 2 && lines.Next(); ++line) {  // the first may be titles
    if (HasDecimalComma(lines.words()))
      lines.Refuse("'" + std::string(lines.words().front()) + " " + std::string(lines.words()[1]) +
                   "' has commas inside of numbers, or not between all of them: write 1.5 for "
                   "1,5, and one comma, or a blank, between numbers");
  }
}

}  // namespace

Eigen::MatrixXd ParsePointText(std::string text, bool all) {
  RefuseDecimalCommas(text);
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
    if (is_header) {
      if (!all && HasOthersThanXyz(words)) {
        lines.Refuse("the columns are " + Listed(words) +
                     ": say which are coordinates, by --columns x,y,z or so; if all are, by "
                     "--ambient " +
                     std::to_string(words.size()));
      }
      continue;
    }
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

using Columns = std::vector<std::string>;

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";  // which spreadsheets begin a CSV with

Eigen::MatrixXd ParseText(std::string text, bool all, const Columns& columns) {
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  return columns.empty() ? files::ParsePointText(std::move(text), all)
                         : files::ParsePointColumns(text, columns);
}

// Of an array, whose columns have these titles, or none.
Eigen::MatrixXd Pick(const Eigen::MatrixXd& points, const std::vector<std::string_view>& titles,
                     const Columns& columns) {
  if (columns.empty()) return points;
  Eigen::MatrixXd picked(std::ssize(columns), points.cols());
  for (Eigen::Index i = 0; i < picked.rows(); ++i) {
    const std::string& column = columns[static_cast<size_t>(i)];
    picked.row(i) = points.row(static_cast<Eigen::Index>(
        files::FindColumn(column, titles, static_cast<size_t>(points.rows()))));
  }
  return picked;
}

Eigen::MatrixXd Parse(const std::filesystem::path& path, bool all, const Columns& columns) {
  if (path == "-") return ParseText({std::istreambuf_iterator<char>(std::cin), {}}, all, columns);
  const std::string ending = files::EndingOf(path);
  if (ending == ".npy") return Pick(files::ParseNpy(files::Contents(path)), {}, columns);
  if (ending == ".ply")
    return Pick(files::ParsePlyPoints(files::Contents(path)), {"x", "y", "z"}, columns);
  for (const char* text : {".xyz", ".csv", ".txt"}) {
    if (ending == text) return ParseText(files::Contents(path), all, columns);
  }
  Refuse("files of points that are read end in .ply, .npy, .csv, .xyz or .txt");
}

}  // namespace

Eigen::MatrixXd ReadPoints(const std::string& path, std::optional<int> coordinates,
                           const std::vector<std::string>& columns) {
  const std::string begin =
      (path == "-" ? "standard input" : "'" + path + "'") + " cannot be read as points: ";
  try {
    Eigen::MatrixXd points = Parse(path, coordinates.has_value(), columns);
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
