#pragma once

#include <vector>

#include "server/otlp/otlp.pb.h"
#include "server/otlp/span_settings.h"
#include "server/spans/span.h"

namespace stellate::server {

// What the process says of itself.
otlp::ResourceSpans DescribeProcess(const SpanSettings& settings, const std::string& version);

// Appends the spans. What clients wrote is made text::Printable.
void ToOtlp(const std::vector<Span>& spans, otlp::ScopeSpans* scope);

}  // namespace stellate::server
