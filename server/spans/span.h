#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "server/spans/trace_context.h"

namespace stellate::server {

using SpanValue = std::variant<std::string, std::int64_t, double, bool>;

// Something that took time, as OpenTelemetry has it.
struct Span {
  TraceContext above;  // its trace, and the span that it is a part of
  SpanId id = NewSpanId();
  std::string name;
  bool is_remote = false;  // what a client's call brought about, not a part of another span here
  std::chrono::system_clock::time_point start, end;
  std::vector<std::pair<std::string, SpanValue>> attributes;
  std::optional<std::string> error;   // why it failed, for people
  std::optional<TraceContext> other;  // a span of another trace that it has to do with

  template <typename T>
  void Add(const char* key, const T& value) {
    using Held = std::conditional_t<
        std::is_same_v<T, bool>, bool,
        std::conditional_t<std::is_floating_point_v<T>, double,
                           std::conditional_t<std::is_integral_v<T>, std::int64_t, std::string>>>;
    attributes.emplace_back(key, static_cast<Held>(value));
  }
  // For spans that are a part of this one.
  TraceContext Within() const { return {above.trace, id, above.sampled, above.state}; }
};

// Takes spans to where they are shown.
class SpanSink {
 public:
  virtual ~SpanSink() = default;
  // All of them, or, where there is no room, none. Any thread; does not block.
  virtual void Take(std::vector<Span> spans) = 0;
};

}  // namespace stellate::server
