#include "core/certificate/rounding.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace stellate::core {
namespace {

// With more, rounding is beside nothing that is asked of an oracle.
constexpr int kMostDigits = 12;
// Fewer coordinates that are not zero may be short by nature.
constexpr int kFewestSeen = 32;

bool IsSingle(double x) {
  return std::abs(x) <= std::numeric_limits<float>::max() &&
         static_cast<double>(static_cast<float>(x)) == x;
}

// The fewest significant decimals that read back as x.
int DigitsOf(double x) {
  char text[40];
  const char* const end =
      std::to_chars(text, text + sizeof text, std::abs(x), std::chars_format::scientific).ptr;
  const char* const exponent = std::find(static_cast<const char*>(text), end, 'e');
  const auto length = static_cast<int>(exponent - text);
  return length > 1 ? length - 1 : 1;  // the point is none
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
    if (digits <= kMostDigits) digits = std::max(digits, DigitsOf(x));
    if (!all_single && digits > kMostDigits) return 0;
  }
  if (seen < kFewestSeen) return 0;
  const double last_place = std::pow(10, std::floor(std::log10(largest)) - (digits - 1));
  const double decimal = digits <= kMostDigits ? last_place / 2 : largest;
  const double single =
      all_single ? largest * (std::numeric_limits<float>::epsilon() / 2) : largest;
  const double moved = std::min(decimal, single) * std::sqrt(static_cast<double>(points.rows()));
  return moved <= most ? moved : 0;
}

}  // namespace stellate::core
