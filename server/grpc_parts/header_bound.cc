#include "server/grpc_parts/header_bound.h"

#include <array>
#include <atomic>
#include <charconv>

namespace stellate::server {
namespace {

std::atomic<std::uint64_t> endless{0};

}  // namespace

bool HeaderBlockFits(std::size_t bytes, std::size_t frames) {
  if (bytes <= kMostHeaderBytes && frames <= kMostHeaderFrames) return true;
  ++endless;
  return false;
}

std::uint64_t EndlessHeaderBlocks() { return endless; }

bool LacksHeaderBound(std::string_view version) {
  std::array<int, 3> parts{};
  const char* at = version.data();
  const char* const end = at + version.size();
  for (int& part : parts) {
    at = std::from_chars(at, end, part).ptr;
    if (at != end) ++at;  // the dot
  }
  const auto [major, minor, patch] = parts;
  if (major != 1 || minor > 56) return major < 1;
  if (minor < 53) return true;
  return patch < (minor == 54 ? 3 : 2);
}

}  // namespace stellate::server
