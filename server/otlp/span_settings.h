#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"
#include "server/config/collector_url.h"

namespace stellate::server {

// Where spans are sent, and what is sent with them.
struct SpanSettings {
  using Pairs = std::vector<std::pair<std::string, std::string>>;

  CollectorUrl url;
  Pairs headers;                              // of each call; may hold secrets
  std::string authority, certificate, key;    // PEM, for TLS; empty: the system's, none, none
  std::chrono::milliseconds timeout{10'000};  // of a call
  std::string service = "stellated";
  Pairs resource;  // more that the process says of itself
};

// Reads one variable of the environment.
using Environment = std::function<std::optional<std::string>(const std::string& name)>;
std::optional<std::string> ReadEnvironment(const std::string& name);

// The settings as --traces-to and OpenTelemetry's own variables make them: OTEL_SDK_DISABLED,
// OTEL_TRACES_EXPORTER, OTEL_SERVICE_NAME, OTEL_RESOURCE_ATTRIBUTES, and of
// OTEL_EXPORTER_OTLP_... ENDPOINT, PROTOCOL, HEADERS, TIMEOUT, CERTIFICATE, CLIENT_CERTIFICATE and
// CLIENT_KEY, each with TRACES_ before it first. `traces_to` comes before the environment's
// endpoint, protocol and switches. Nothing: no spans are asked for. kInvalidArgument: they cannot
// be sent as that says; names the variable, and never a header's value.
core::Expected<std::optional<SpanSettings>> FindSpanSettings(const std::string& traces_to,
                                                             const Environment& environment);

}  // namespace stellate::server
