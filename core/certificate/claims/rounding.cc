#include "core/certificate/claims/rounding.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

#include "core/base/message.h"

namespace stellate::core {
namespace {

// With more digits, rounding is far below every tolerance for oracles.
constexpr int kMostDigits = 12;
// Fewer nonzero coordinates may have few digits by nature.
constexpr int kFewestSeen = 32;

bool IsSingle(double x) {
  return std::abs(x) <= std::numeric_limits<float>::max() &&
         static_cast<double>(static_cast<float>(x)) == x;
}

struct Decimal {
  int digits = 1;    // the fewest significant ones that read back as the number
  int exponent = 0;  // of ten, of the first digit
};

Decimal DecimalOf(double x) {
  char text[40];
  const char* const end =
      std::to_chars(text, text + sizeof text, std::abs(x), std::chars_format::scientific).ptr;
  const char* const exponent = std::find(static_cast<const char*>(text), end, 'e');
  const auto length = static_cast<int>(exponent - text);
  Decimal decimal;
  if (length > 1) decimal.digits = length - 1;  // the point is none
  const char* const first = exponent[1] == '+' ? exponent + 2 : exponent + 1;
  std::from_chars(first, end, decimal.exponent);
  return decimal;
}

// As the compiler reads 1eN: std::pow rounds as the processor has it.
double PowerOfTen(int exponent) {
  const std::string text = Message("1e", exponent);
  double power = 0;
  std::from_chars(text.data(), text.data() + text.size(), power);
  return power;
}

}  // namespace

double RoundingOf(const Eigen::MatrixXd& points, double most) {
  if (points.size() == 0) return 0;
  const double largest = points.cwiseAbs().maxCoeff();
  if (!(largest > 0)) return 0;
  bool all_single = true;
  int digits = 1, seen = 0;
  for (Eigen::Index i = 0; i < points.size(); ++i) {
    const double x = points.data()[i];
    seen += x != 0;
    all_single = all_single && IsSingle(x);
    if (digits <= kMostDigits) digits = std::max(digits, DecimalOf(x).digits);
    if (!all_single && digits > kMostDigits) return 0;
  }
  if (seen < kFewestSeen) return 0;
  const double last_place = PowerOfTen(DecimalOf(largest).exponent - (digits - 1));
  const double decimal = digits <= kMostDigits ? last_place / 2 : largest;
  const double single =
      all_single ? largest * (std::numeric_limits<float>::epsilon() / 2) : largest;
  const double moved = std::min(decimal, single) * std::sqrt(static_cast<double>(points.rows()));
  return moved <= most ? moved : 0;
}

}  // namespace stellate::core
