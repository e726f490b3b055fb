#include "server/otlp/span_settings.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string_view>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

// Two digits after a percent sign are a byte. What is none stays as it is.
std::string Decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char byte = 0;
    const char* const digits = text.data() + i + 1;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      decoded += static_cast<char>(byte);
      i += 2;
    } else {
      decoded += text[i];
    }
  }
  return decoded;
}

// "a=1,b=2", as W3C's Baggage writes it. Nothing: it is none.
std::optional<SpanSettings::Pairs> ReadPairs(std::string_view text) {
  SpanSettings::Pairs pairs;
  while (!text.empty()) {
    const std::size_t comma = text.find(',');
    const std::string_view pair = Trimmed(text.substr(0, comma));
    text.remove_prefix(comma == std::string_view::npos ? text.size() : comma + 1);
    if (pair.empty()) continue;
    const std::size_t equals = pair.find('=');
    const std::string key = Decoded(Trimmed(pair.substr(0, equals)));
    if (equals == std::string_view::npos || key.empty()) return std::nullopt;
    pairs.emplace_back(key, Decoded(Trimmed(pair.substr(equals + 1))));
  }
  return pairs;
}

// gRPC ends the process over a header that it may not send.
bool MayBeSent(const std::pair<std::string, std::string>& header) {
  const auto& [key, value] = header;
  return !key.starts_with("grpc-") && !key.ends_with("-bin") &&
         std::all_of(key.begin(), key.end(),
                     [](unsigned char c) {
                       return std::isdigit(c) != 0 || (c >= 'a' && c <= 'z') || c == '-' ||
                              c == '_' || c == '.';
                     }) &&
         std::all_of(value.begin(), value.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

// Reads OTLP's variables, those of traces first.
class Variables {
 public:
  explicit Variables(const Environment& environment) : environment_(environment) {}

  // An empty one is as one that is not there.
  std::string Get(const std::string& name) const {
    const auto value = environment_(name);
    return value ? std::string(Trimmed(*value)) : "";
  }
  // `name` becomes the whole name of the one that is there.
  std::string Otlp(std::string* name) const {
    const std::string of_traces = "OTEL_EXPORTER_OTLP_TRACES_" + *name;
    const std::string value = Get(of_traces);
    *name = value.empty() ? "OTEL_EXPORTER_OTLP_" + *name : of_traces;
    return value.empty() ? Get(*name) : value;
  }

 private:
  const Environment& environment_;
};

core::Status Mistake(std::string message) {
  return {core::StatusCode::kInvalidArgument, std::move(message)};
}

core::Status ReadHeaders(const Variables& variables, SpanSettings* settings) {
  std::string name = "HEADERS";
  auto headers = ReadPairs(variables.Otlp(&name));
  if (headers) {
    for (auto& [key, value] : *headers) key = Lower(key);
  }
  if (!headers || !std::all_of(headers->begin(), headers->end(), MayBeSent)) {
    return Mistake(Message(name,
                           " must be NAME=VALUE,NAME=VALUE: names of letters, digits, '-', '_' "
                           "and '.', not grpc-... nor ...-bin, and values of printable ASCII, "
                           "whose commas and spaces may be %2C and %20"));
  }
  settings->headers = std::move(*headers);
  return core::Status::Ok();
}

core::Status ReadTimeout(const Variables& variables, SpanSettings* settings) {
  std::string name = "TIMEOUT";
  const std::string text = variables.Otlp(&name);
  if (text.empty()) return core::Status::Ok();
  int milliseconds = 0;
  const char* const end = text.data() + text.size();
  if (std::from_chars(text.data(), end, milliseconds).ptr != end || milliseconds < 1) {
    return Mistake(Message(name, " is \"", text, "\" but must be a number of milliseconds"));
  }
  settings->timeout = std::chrono::milliseconds(milliseconds);
  return core::Status::Ok();
}

core::Status ReadPem(const Variables& variables, std::string name, std::string* pem) {
  const std::string path = variables.Otlp(&name);
  if (path.empty()) return core::Status::Ok();
  std::ifstream file(path, std::ios::binary);
  pem->assign(std::istreambuf_iterator<char>(file), {});
  if (pem->find("-----BEGIN") != std::string::npos) return core::Status::Ok();
  return Mistake(Message(name, " is ", path, " but no PEM can be read from it"));
}

core::Status ReadTls(const Variables& variables, SpanSettings* settings) {
  if (!settings->url.tls) return core::Status::Ok();
  for (const auto& [name, pem] : {std::pair("CERTIFICATE", &settings->authority),
                                  std::pair("CLIENT_CERTIFICATE", &settings->certificate),
                                  std::pair("CLIENT_KEY", &settings->key)}) {
    core::Status status = ReadPem(variables, name, pem);
    if (!status.ok()) return status;
  }
  if (settings->certificate.empty() == settings->key.empty()) return core::Status::Ok();
  return Mistake(
      "OTEL_EXPORTER_OTLP_CLIENT_CERTIFICATE and OTEL_EXPORTER_OTLP_CLIENT_KEY go together: give "
      "both or neither");
}

core::Status ReadResource(const Variables& variables, SpanSettings* settings) {
  auto resource = ReadPairs(variables.Get("OTEL_RESOURCE_ATTRIBUTES"));
  if (!resource) return Mistake("OTEL_RESOURCE_ATTRIBUTES must be NAME=VALUE,NAME=VALUE");
  for (auto& [key, value] : *resource) {
    if (key == "service.name") settings->service = value;
  }
  std::erase_if(*resource, [](const auto& pair) { return pair.first == "service.name"; });
  settings->resource = std::move(*resource);
  const std::string service = variables.Get("OTEL_SERVICE_NAME");
  if (!service.empty()) settings->service = service;
  return core::Status::Ok();
}

// Whether the environment asks for spans, and for OTLP over gRPC.
core::Expected<bool> AsksForSpans(const Variables& variables, std::string* endpoint,
                                  std::string* name) {
  *name = "ENDPOINT";
  *endpoint = variables.Otlp(name);
  if (endpoint->empty() || Lower(variables.Get("OTEL_SDK_DISABLED")) == "true") return false;
  const std::string exporter = Lower(variables.Get("OTEL_TRACES_EXPORTER"));
  if (!exporter.empty() && exporter != "otlp") return false;
  std::string protocol_name = "PROTOCOL";
  const std::string protocol = variables.Otlp(&protocol_name);
  if (protocol.empty() || protocol == "grpc") return true;
  return core::Refuse(core::StatusCode::kInvalidArgument,
                      Message(protocol_name, " is \"", protocol,
                              "\" but stellated sends by grpc alone: say where with --traces-to"));
}

}  // namespace

std::optional<std::string> ReadEnvironment(const std::string& name) {
  const char* const value = std::getenv(name.c_str());
  if (value == nullptr) return std::nullopt;
  return value;
}

core::Expected<std::optional<SpanSettings>> FindSpanSettings(const std::string& traces_to,
                                                             const Environment& environment) {
  const Variables variables(environment);
  std::string endpoint = traces_to, name = "--traces-to";
  if (endpoint.empty()) {
    const auto asks = AsksForSpans(variables, &endpoint, &name);
    if (!asks) return tl::unexpected(asks.error());
    if (!*asks) return std::nullopt;
  }
  SpanSettings settings;
  auto url = ParseCollectorUrl(endpoint, name);
  if (!url) return tl::unexpected(std::move(url.error()));
  settings.url = std::move(*url);
  for (const auto read : {ReadHeaders, ReadTimeout, ReadTls, ReadResource}) {
    core::Status status = read(variables, &settings);
    if (!status.ok()) return tl::unexpected(std::move(status));
  }
  return settings;
}

}  // namespace stellate::server
