#include "oracles/files/columns.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include "oracles/combined/common.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

constexpr size_t kMostListed = 20;

std::string_view Trimmed(std::string_view text) {
  constexpr const char* kBlanks = " \t\r";
  const size_t begin = std::min(text.find_first_not_of(kBlanks), text.size());
  text.remove_prefix(begin);
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

// What is on a line: between commas, if the file has any on its first line, else between blanks.
std::vector<std::string_view> Fields(const Lines& lines, bool by_commas) {
  if (!by_commas) return lines.words();
  const std::string_view first = lines.words().front(), last = lines.words().back();
  const std::string_view line(first.data(),
                              static_cast<size_t>(last.data() + last.size() - first.data()));
  std::vector<std::string_view> fields = pipe::Split(line, ',');
  std::transform(fields.begin(), fields.end(), fields.begin(), Trimmed);
  return fields;
}

bool HasComma(const Lines& lines) {
  return std::any_of(lines.words().begin(), lines.words().end(), [](std::string_view word) {
    return word.find(',') != std::string_view::npos;
  });
}

bool IsNumber(std::string_view field) {
  double ignored = 0;
  return pipe::ParseNumber(field, &ignored);
}

}  // namespace

std::string_view Unquoted(std::string_view title) {
  if (title.size() < 2 || title.front() != title.back()) return title;
  return title.front() == '"' || title.front() == '\'' ? title.substr(1, title.size() - 2) : title;
}

std::string Listed(const std::vector<std::string_view>& titles) {
  std::string list;
  for (size_t i = 0; i < std::min(titles.size(), kMostListed); ++i)
    list += (i == 0 ? "" : ", ") + pipe::Quoted(Unquoted(titles[i]));
  return list + (titles.size() > kMostListed ? ", ..." : "");
}

size_t FindColumn(const std::string& column, const std::vector<std::string_view>& titles,
                  size_t width) {
  const auto titled = std::find_if(titles.begin(), titles.end(), [&](std::string_view title) {
    return Unquoted(title) == column;
  });
  if (titled != titles.end()) return static_cast<size_t>(titled - titles.begin());
  size_t number = 0;
  const char* const end = column.data() + column.size();
  const auto parsed = std::from_chars(column.data(), end, number);
  if (parsed.ec == std::errc() && parsed.ptr == end && number >= 1 && number <= width)
    return number - 1;
  Refuse("it has no column " + pipe::Quoted(column) + ": there are " + std::to_string(width) +
         (titles.empty() ? ", without titles" : ", " + Listed(titles)));
}

Eigen::MatrixXd ParsePointColumns(std::string_view text, const std::vector<std::string>& columns) {
  Lines lines(text, '#');
  std::vector<size_t> picked;
  std::vector<double> numbers;
  size_t width = 0, first = 0;
  bool by_commas = false;
  while (lines.Next()) {
    if (width == 0) by_commas = HasComma(lines);
    const std::vector<std::string_view> fields = Fields(lines, by_commas);
    if (width == 0) {
      width = fields.size();
      first = lines.number();
      const bool titled = std::none_of(fields.begin(), fields.end(), IsNumber);
      for (const std::string& column : columns)
        picked.push_back(
            FindColumn(column, titled ? fields : std::vector<std::string_view>(), width));
      if (titled) continue;
    }
    if (fields.size() != width) {
      lines.Refuse("has " + std::to_string(fields.size()) + " columns, and line " +
                   std::to_string(first) + " has " + std::to_string(width));
    }
    for (const size_t column : picked) {
      double number = 0;
      if (!pipe::ParseNumber(fields[column], &number) || !std::isfinite(number))
        lines.Refuse(pipe::Quoted(fields[column]) + " is no finite number, written like -1.5e3");
      numbers.push_back(number);
    }
  }
  if (numbers.empty()) Refuse("it has no points");
  const auto d = std::ssize(columns);
  return Eigen::Map<const Eigen::MatrixXd>(numbers.data(), d, std::ssize(numbers) / d);
}

}  // namespace stellate::oracles::files
