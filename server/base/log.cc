#include "server/base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string_view>

#include "core/base/message.h"
#include "server/base/line_ration.h"
#include "text/printable.h"

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

// A client that keeps to its limits says less; all day long, ten a second are 200 MB.
constexpr int kBurst = 100;
constexpr double kLinesASecond = 10;
// Who writes lines, each with a ration of its own.
constexpr char kServer[] = "the server";
constexpr char kLibraries[] = "libraries";
constexpr char kMeshes[] = "meshes";  // of an owner

LineRation& Ration() {
  static LineRation ration(kBurst, kLinesASecond);
  return ration;
}

void Write(LogLevel level, const LogContext& context, const std::string& message,
           const LogFields& fields) {
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
    line += message + fields.text();
  }
  // A client's words must not forge a line of the log, nor command the terminal that shows it.
  Logger().log(ToSpdlog(level), std::string_view(text::Printable(line)));
}

// Finer lines are there for whoever asked for them.
void LogFor(const std::string& party, LogLevel level, const LogContext& context,
            const std::string& message, const LogFields& fields) {
  if (!LogEnabled(level)) return;
  if (level >= LogLevel::kInfo && !Ration().Take(party, std::chrono::steady_clock::now())) return;
  Write(level, context, message, fields);
}

}  // namespace

void StartLogging(LogLevel level, LogFormat wanted) {
  format = wanted;
  SetLogLevel(level);
  Logger().set_pattern(wanted == LogFormat::kJson
                           ? R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})"
                           : "%Y-%m-%d %H:%M:%S.%e %^%l%$ %v");
}

void SetLogLevel(LogLevel level) { Logger().set_level(ToSpdlog(level)); }

bool LogEnabled(LogLevel level) { return Logger().should_log(ToSpdlog(level)); }

void Log(LogLevel level, const LogContext& context, const std::string& message,
         const LogFields& fields) {
  std::string party = context.mesh.empty() ? kServer : kMeshes;
  if (!context.owner.empty()) party += " of owner " + context.owner;
  LogFor(party, level, context, message, fields);
}

void LogLibrary(LogLevel level, const std::string& message) {
  LogFor(kLibraries, level, {}, core::Message(kLibraries, ": ", message), {});
}

void LogLeftOut() {
  for (const auto& [party, lines] : Ration().TakeLeftOut(std::chrono::steady_clock::now())) {
    Write(LogLevel::kWarning, {}, core::Message(party, ": more lines were left out"),
          LogFields().Add("lines", lines));
  }
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
