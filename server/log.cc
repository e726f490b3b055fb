#include "server/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <memory>
#include <string_view>

namespace stellate::server {
namespace {

std::atomic<LogFormat> format{LogFormat::kText};

spdlog::level::level_enum ToSpdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kTrace:
      return spdlog::level::trace;
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      return spdlog::level::off;
  }
  return spdlog::level::info;
}

spdlog::logger& Logger() {
  static const std::shared_ptr<spdlog::logger> logger = [] {
    auto made = std::make_shared<spdlog::logger>(
        "stellated", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    made->set_level(spdlog::level::warn);
    made->flush_on(spdlog::level::info);
    return made;
  }();
  return *logger;
}

}  // namespace

void StartLogging(LogLevel level, LogFormat wanted) {
  format = wanted;
  Logger().set_level(ToSpdlog(level));
  Logger().set_pattern(wanted == LogFormat::kJson
                           ? R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})"
                           : "%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
}

bool LogEnabled(LogLevel level) { return Logger().should_log(ToSpdlog(level)); }

void Log(LogLevel level, const LogContext& context, const std::string& message,
         const LogFields& fields) {
  if (!LogEnabled(level)) return;
  std::string line;
  if (format == LogFormat::kJson) {
    if (!context.mesh.empty()) {
      line = "\"mesh\":" + JsonString(context.mesh) +
             ",\"round\":" + std::to_string(context.round) + ",";
    }
    line += "\"message\":" + JsonString(message) + fields.json();
  } else {
    if (!context.mesh.empty()) {
      line = "[" + context.mesh + " round " + std::to_string(context.round) + "] ";
    }
    // A client's words must not forge a line of the log, nor command the terminal that shows it.
    unsigned char before = 0;
    for (const char c : message + fields.text()) {
      const auto byte = static_cast<unsigned char>(c);
      const bool latin = before == 0xc2 && byte >= 0x80 && byte < 0xa0;  // U+0080 to U+009F
      if (latin) line.back() = ' ';
      line += byte < 0x20 || byte == 0x7f || latin ? ' ' : c;
      before = byte;
    }
  }
  Logger().log(ToSpdlog(level), std::string_view(line));
}

std::string JsonString(const std::string& text) {
  static constexpr char kHex[] = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      out += "\\u00";
      out += kHex[byte >> 4];
      out += kHex[byte & 15];
    } else {
      out += c;
    }
  }
  return out + "\"";
}

}  // namespace stellate::server
