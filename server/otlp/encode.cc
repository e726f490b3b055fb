#include "server/otlp/encode.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <type_traits>

#include "text/printable.h"

namespace stellate::server {
namespace {

template <std::size_t n>
std::string BytesOf(const std::array<std::uint8_t, n>& id) {
  return {reinterpret_cast<const char*>(id.data()), n};
}

std::uint64_t Nanoseconds(std::chrono::system_clock::time_point time) {
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count());
}

void SetValue(const SpanValue& value, otlp::AnyValue* any) {
  std::visit(
      [any](const auto& held) {
        using T = std::decay_t<decltype(held)>;
        if constexpr (std::is_same_v<T, std::string>) any->set_string_value(text::Printable(held));
        if constexpr (std::is_same_v<T, std::int64_t>) any->set_int_value(held);
        if constexpr (std::is_same_v<T, double>) any->set_double_value(held);
        if constexpr (std::is_same_v<T, bool>) any->set_bool_value(held);
      },
      value);
}

void AddText(const std::string& key, const std::string& value, otlp::Resource* resource) {
  otlp::KeyValue& pair = *resource->add_attributes();
  pair.set_key(text::Printable(key));
  pair.mutable_value()->set_string_value(text::Printable(value));
}

void ToOtlp(const Span& span, otlp::Span* out) {
  out->set_trace_id(BytesOf(span.above.trace));
  out->set_span_id(BytesOf(span.id));
  out->set_trace_state(span.above.state);
  if (span.above.span != SpanId{}) out->set_parent_span_id(BytesOf(span.above.span));
  out->set_name(span.name);
  out->set_kind(span.is_remote ? otlp::Span::KIND_SERVER : otlp::Span::KIND_INTERNAL);
  out->set_start_time_unix_nano(Nanoseconds(span.start));
  out->set_end_time_unix_nano(Nanoseconds(std::max(span.start, span.end)));
  for (const auto& [key, value] : span.attributes) {
    otlp::KeyValue& pair = *out->add_attributes();
    pair.set_key(key);
    SetValue(value, pair.mutable_value());
  }
  if (span.other) {
    otlp::Link& link = *out->add_links();
    link.set_trace_id(BytesOf(span.other->trace));
    link.set_span_id(BytesOf(span.other->span));
  }
  if (!span.error) return;
  out->mutable_status()->set_code(otlp::Status::CODE_ERROR);
  out->mutable_status()->set_message(text::Printable(*span.error));
}

}  // namespace

otlp::ResourceSpans DescribeProcess(const SpanSettings& settings, const std::string& version) {
  otlp::ResourceSpans spans;
  otlp::Resource& resource = *spans.mutable_resource();
  AddText("service.name", settings.service, &resource);
  AddText("service.version", version, &resource);
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) == 0) AddText("host.name", name.data(), &resource);
  for (const auto& [key, value] : settings.resource) AddText(key, value, &resource);
  otlp::Scope& scope = *spans.add_scope_spans()->mutable_scope();
  scope.set_name("stellated");
  scope.set_version(version);
  return spans;
}

void ToOtlp(const std::vector<Span>& spans, otlp::ScopeSpans* scope) {
  for (const Span& span : spans) ToOtlp(span, scope->add_spans());
}

}  // namespace stellate::server
