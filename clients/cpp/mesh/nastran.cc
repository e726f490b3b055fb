// Nastran bulk data, byte for byte as Python's client writes it.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>

#include "mesh/formats.h"

namespace stellate::client {
namespace {

constexpr std::size_t kWidth = 16;                // of a number, in a card with wide fields
constexpr int kMost = 100'000'000 - 1;            // a field of eight columns
constexpr int kLeastFixed = -4, kMostFixed = 15;  // powers of ten that need no exponent

struct Decimal {
  std::string digits;  // without a point
  int exponent = 0;    // of the first of them
};

// The magnitude, in as few digits as tell it, or in `precision` of them behind the first.
template <typename... Precision>
Decimal DecimalOf(double value, Precision... precision) {
  std::array<char, 40> text{};  // atoi stops at a zero behind the number
  const auto end = std::to_chars(text.data(), text.data() + text.size(), std::abs(value),
                                 std::chars_format::scientific, precision...)
                       .ptr;
  const std::string_view all(text.data(), static_cast<std::size_t>(end - text.data()));
  const std::size_t e = all.find('e');
  Decimal decimal{std::string(all.substr(0, e)), std::atoi(text.data() + e + 1)};
  if (decimal.digits.size() > 1) decimal.digits.erase(1, 1);
  return decimal;
}

std::string Fixed(const Decimal& decimal) {
  const auto& [digits, exponent] = decimal;
  if (exponent < 0)
    return "0." + std::string(static_cast<std::size_t>(-exponent - 1), '0') + digits;
  const auto whole = static_cast<std::size_t>(exponent) + 1;
  if (digits.size() <= whole) return digits + std::string(whole - digits.size(), '0') + ".0";
  return digits.substr(0, whole) + "." + digits.substr(whole);
}

// With a point, as Nastran has it, and as many digits as fit.
std::string Real(double value) {
  const std::string sign = std::signbit(value) ? "-" : "";
  const Decimal shortest = DecimalOf(value);
  if (kLeastFixed <= shortest.exponent && shortest.exponent <= kMostFixed) {
    if (std::string text = sign + Fixed(shortest); text.size() <= kWidth) return text;
  }
  std::string text;
  for (int precision = 15; precision > 0; --precision) {
    const auto [digits, exponent] = DecimalOf(value, precision);
    text = sign + digits.substr(0, 1) + "." + digits.substr(1) + (exponent < 0 ? "E" : "E+") +
           std::to_string(exponent);
    if (text.size() <= kWidth) break;
  }
  return text;
}

std::string Right(std::size_t width, const std::string& text) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

}  // namespace

Expected<std::string> Nastran(const Mesh& mesh) {
  constexpr const char* kCards[] = {"", "CROD    ", "CTRIA3  ", "CTETRA  "};
  if (std::max(mesh.points.cols(), mesh.simplices.cols()) > kMost) {
    return Fail(ErrorCode::kFileFailed,
                "Nastran numbers points and elements by eight digits: save it as .vtu");
  }
  const Eigen::MatrixXd points = InSpace(mesh.points);
  std::string text = "BEGIN BULK\n";
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    text += "GRID*   " + Right(kWidth, std::to_string(j + 1)) + std::string(kWidth, ' ');
    text += Right(kWidth, Real(points(0, j))) + Right(kWidth, Real(points(1, j)));
    text += "*\n*       " + Right(kWidth, Real(points(2, j))) + "\n";
  }
  std::size_t number = 0;
  for (const Group& group : GroupsOf(mesh)) {
    if (group.dimension() < mesh.dimension()) continue;
    for (const auto& cell : group.simplices.colwise()) {
      text += kCards[mesh.dimension()];
      text += Right(8, std::to_string(++number)) + Right(8, std::to_string(group.tag));
      for (const std::uint32_t id : cell) text += Right(8, std::to_string(std::uint64_t{id} + 1));
      text += '\n';
    }
  }
  return text + "ENDDATA\n";
}

}  // namespace stellate::client
