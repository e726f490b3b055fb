#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace stellate::server {

using TraceId = std::array<std::uint8_t, 16>;
using SpanId = std::array<std::uint8_t, 8>;

// The two headers of W3C's Trace Context, as a client sent them. Empty: it sent none.
struct TraceHeaders {
  std::string parent;  // traceparent
  std::string state;   // tracestate

  bool operator==(const TraceHeaders&) const = default;
};

// Names of the headers.
inline constexpr char kTraceParent[] = "traceparent";
inline constexpr char kTraceState[] = "tracestate";
// Of a traceparent as far as it is understood; what a later version adds comes behind.
inline constexpr std::size_t kTraceParentBytes = 55;

// Where a span belongs: its trace, and the span above it.
struct TraceContext {
  TraceId trace{};
  SpanId span{};        // all zero: none is above it
  bool sampled = true;  // else the client wants no spans of it
  std::string state;    // handed on as it came
};

// Reads what a client sent; nothing where it is no trace context, as W3C has it. A state of more
// than 512 bytes, or with anything but printable ASCII in it, is left out.
std::optional<TraceContext> ReadTraceContext(const TraceHeaders& headers);

// Drawn by the operating system; never all zero.
SpanId NewSpanId();
TraceId NewTraceId();

// The trace of a mesh whose client began none: the 32 digits of its name, so that it is found by
// that name, and goes on on another server. A drawn one for a name without digits, or all zero.
TraceId TraceOfMesh(std::string_view name);

}  // namespace stellate::server
