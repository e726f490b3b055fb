#include "server/spans/trace_context.h"

#include <sys/random.h>

#include <algorithm>
#include <cerrno>
#include <random>

namespace stellate::server {
namespace {

constexpr std::size_t kMostState = 512;  // bytes: what W3C asks everybody to hand on

int DigitOf(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;  // W3C allows no capitals
}

// False: it is not as many digits.
template <std::size_t n>
bool ReadHex(std::string_view text, std::array<std::uint8_t, n>* bytes) {
  if (text.size() != 2 * n) return false;
  for (std::size_t i = 0; i < n; ++i) {
    const int high = DigitOf(text[2 * i]), low = DigitOf(text[2 * i + 1]);
    if (high < 0 || low < 0) return false;
    (*bytes)[i] = static_cast<std::uint8_t>(high * 16 + low);
  }
  return true;
}

template <std::size_t n>
bool IsZero(const std::array<std::uint8_t, n>& bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::uint8_t byte) { return byte == 0; });
}

template <std::size_t n>
std::array<std::uint8_t, n> Drawn() {
  std::array<std::uint8_t, n> bytes{};
  while (IsZero(bytes)) {
    const ssize_t got = getrandom(bytes.data(), n, 0);
    if (got == static_cast<ssize_t>(n) || (got < 0 && errno == EINTR)) continue;
    // Spans are no secret: any draw will do.
    std::random_device device;
    std::generate(bytes.begin(), bytes.end(),
                  [&device] { return static_cast<std::uint8_t>(device()); });
  }
  return bytes;
}

bool IsFitState(const std::string& state) {
  return state.size() <= kMostState &&
         std::all_of(state.begin(), state.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

}  // namespace

std::optional<TraceContext> ReadTraceContext(const TraceHeaders& headers) {
  // VERSION-TRACE-SPAN-FLAGS; a later version may add to it, after another dash.
  constexpr std::size_t kLength = kTraceParentBytes;
  const std::string_view text = headers.parent;
  if (text.size() < kLength || text[2] != '-' || text[35] != '-' || text[52] != '-') return {};
  std::array<std::uint8_t, 1> version{}, flags{};
  TraceContext context;
  if (!ReadHex(text.substr(0, 2), &version) || !ReadHex(text.substr(3, 32), &context.trace) ||
      !ReadHex(text.substr(36, 16), &context.span) || !ReadHex(text.substr(53, 2), &flags)) {
    return {};
  }
  const bool is_longer = text.size() > kLength;
  if (version[0] == 0xff || (is_longer && (version[0] == 0 || text[kLength] != '-'))) return {};
  if (IsZero(context.trace) || IsZero(context.span)) return {};
  context.sampled = (flags[0] & 1) != 0;
  if (IsFitState(headers.state)) context.state = headers.state;
  return context;
}

SpanId NewSpanId() { return Drawn<8>(); }
TraceId NewTraceId() { return Drawn<16>(); }

TraceId TraceOfMesh(std::string_view name) {
  TraceId trace{};
  const std::size_t slash = name.rfind('/');
  if (slash == std::string_view::npos || !ReadHex(name.substr(slash + 1), &trace) ||
      IsZero(trace)) {
    return NewTraceId();
  }
  return trace;
}

}  // namespace stellate::server
