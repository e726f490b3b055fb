// Files of triangles by anybody: refused with words, or triangles that name points that are there,
// no more of either than the bytes can hold.
//
// An input is a byte that chooses the format, and the file.

#include <iterator>
#include <stdexcept>

#include "oracles/files/formats.h"
#include "tests/fuzz/target.h"
#include "tests/support/triangle_files.h"

namespace stellate::fuzz {
namespace {

constexpr std::size_t kCount = std::size(oracles::files::kFormats);

}  // namespace

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  for (const testing::TriangleFile& file : testing::TetrahedronFiles()) {
    for (std::size_t i = 0; i < kCount; ++i) {
      if (file.ending != oracles::files::kFormats[i].ending) continue;
      seeds.push_back(std::string(1, char(i)) + file.bytes);
    }
  }
  seeds.push_back(std::string(1, '\1') +
                  "ply\nformat ascii 1.0\nproperty float x\nend_header\n0\n");
  seeds.push_back(std::string(1, '\0') + "OFF\n1000000000 1000000000 0\n0 0 0\n");
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const oracles::Triangles read = oracles::files::kFormats[data[0] % fuzz::kCount].parse(bytes);
    const auto most = static_cast<Eigen::Index>(size);
    fuzz::Require(read.points.rows() == 3 && read.points.allFinite(), "points are finite");
    fuzz::Require(read.corners.rows() == 3 && read.corners.cols() > 0, "there are triangles");
    fuzz::Require(read.corners.minCoeff() >= 0, "corners are points");
    fuzz::Require(read.corners.maxCoeff() < read.points.cols(), "corners are points");
    fuzz::Require(read.points.cols() <= most && read.corners.cols() <= most, "no more than bytes");
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
