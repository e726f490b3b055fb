// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html: a line of Python says
// what the numbers are, which follow.
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "oracles/files/bytes.h"
#include "oracles/files/formats.h"
#include "oracles/files/lines.h"
#include "pipe/numbers.h"

namespace stellate::oracles::files {
namespace {

constexpr std::string_view kMagic("\x93NUMPY", 6);

struct NpyHeader {
  char kind = 'f';  // or 'i', 'u'
  int size = 8;     // bytes of a number
  std::endian order = std::endian::little;
  bool columns = false;  // one column after the other
  std::uint64_t rows = 0, width = 0;
  size_t body = 0;  // begins there
};

// What follows 'key': in the dictionary, without blanks.
std::string_view ValueOf(std::string_view text, std::string_view key) {
  const size_t at = text.find("'" + std::string(key) + "':");
  if (at == std::string_view::npos) Refuse("its header has no '" + std::string(key) + "'");
  text.remove_prefix(at + key.size() + 3);
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  return text;
}

std::uint64_t TakeExtent(std::string_view* text) {
  text->remove_prefix(std::min(text->find_first_not_of(" ,("), text->size()));
  std::uint64_t extent = 0;
  const auto [end, status] = std::from_chars(text->data(), text->data() + text->size(), extent);
  if (status != std::errc()) Refuse("its array has not two axes, points and coordinates");
  text->remove_prefix(static_cast<size_t>(end - text->data()));
  return extent;
}

NpyHeader ParseHeader(std::string_view bytes) {
  Bytes in(bytes, kMagic.size(), std::endian::little);
  const int major = in.Take<std::uint8_t>();
  in.Take<std::uint8_t>();
  const size_t size = major == 1 ? in.Take<std::uint16_t>() : in.Take<std::uint32_t>();
  if (major < 1 || major > 3) {
    Refuse("it is of version " + std::to_string(major) + " of its format, and 1 to 3 are read");
  }
  if (size > in.left()) Refuse("its header is cut short");
  NpyHeader header;
  header.body = in.at() + size;
  const std::string_view text = bytes.substr(in.at(), size);
  const std::string_view type = ValueOf(text, "descr");
  // '<f8'
  const std::string_view name = type.substr(0, type.find('\'', 1));
  const bool is_plain = name.size() == 4 && name[0] == '\'' && name[3] >= '1' && name[3] <= '8';
  header.size = is_plain ? name[3] - '0' : 0;
  header.kind = is_plain ? name[2] : ' ';
  header.order = is_plain && name[1] == '>' ? std::endian::big : std::endian::little;
  const bool is_float = header.kind == 'f' && (header.size == 4 || header.size == 8);
  const bool is_whole = (header.kind == 'i' || header.kind == 'u') &&
                        std::has_single_bit(static_cast<unsigned>(header.size));
  if (!is_float && !is_whole) {
    Refuse("its numbers are of the type " +
           pipe::Quoted(name.substr(std::min<size_t>(1, name.size()))) +
           ", and floats of 4 and 8 bytes and whole numbers are read");
  }
  header.columns = ValueOf(text, "fortran_order").starts_with("True");
  std::string_view shape = ValueOf(text, "shape");
  shape = shape.substr(0, shape.find(')'));
  header.rows = TakeExtent(&shape);
  header.width = TakeExtent(&shape);
  if (shape.find_first_not_of(" ,") != std::string_view::npos) {
    Refuse("its array has more than two axes, points and coordinates");
  }
  return header;
}

double TakeNumber(const NpyHeader& header, Bytes* in) {
  if (header.kind == 'f') {
    return header.size == 4 ? static_cast<double>(in->Take<float>()) : in->Take<double>();
  }
  const auto whole = [&]<typename Signed, typename Unsigned>(Signed, Unsigned) {
    return header.kind == 'i' ? static_cast<double>(in->Take<Signed>())
                              : static_cast<double>(in->Take<Unsigned>());
  };
  switch (header.size) {
    case 1:
      return whole(std::int8_t(), std::uint8_t());
    case 2:
      return whole(std::int16_t(), std::uint16_t());
    case 4:
      return whole(std::int32_t(), std::uint32_t());
    default:
      return whole(std::int64_t(), std::uint64_t());
  }
}

}  // namespace

Eigen::MatrixXd ParseNpy(std::string_view bytes) {
  if (!bytes.starts_with(kMagic)) Refuse("it does not begin as a .npy file does");
  const NpyHeader header = ParseHeader(bytes);
  Bytes in(bytes, header.body, header.order);
  if (header.width == 0) Refuse("its points have no coordinates");
  CheckAgainstSize(header.width, "numbers of a point", static_cast<size_t>(header.size), in.left(),
                   in.place());
  CheckAgainstSize(header.rows, "points", static_cast<size_t>(header.size) * header.width,
                   in.left(), in.place());
  Eigen::MatrixXd points(static_cast<Eigen::Index>(header.width),
                         static_cast<Eigen::Index>(header.rows));
  const Eigen::Index outer = header.columns ? points.rows() : points.cols();
  for (Eigen::Index a = 0; a < outer; ++a) {
    for (Eigen::Index b = 0; b < points.size() / outer; ++b) {
      const double number = TakeNumber(header, &in);
      const Eigen::Index row = header.columns ? b : a, coordinate = header.columns ? a : b;
      if (!std::isfinite(number)) {
        Refuse("coordinate " + std::to_string(coordinate) + " of row " + std::to_string(row) +
               " is not finite");
      }
      points(coordinate, row) = number;
    }
  }
  return points;
}

}  // namespace stellate::oracles::files
