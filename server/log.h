#pragma once

#include <cstdint>
#include <string>

#include "server/log_fields.h"

namespace stellate::server {

enum class LogLevel { kTrace, kDebug, kInfo, kWarning, kError, kOff };
enum class LogFormat { kText, kJson };

// Starts logging to stderr. Before it, and in tests, nothing is logged below warnings.
void StartLogging(LogLevel level, LogFormat format);

// What a line is about; `mesh` empty when it is about the server.
struct LogContext {
  std::string mesh;
  std::uint64_t round = 0;
};

bool LogEnabled(LogLevel level);
// One line, with the mesh's name and round. JSON: an object with time, level, mesh, round, message.
// The fields follow: as members of the object, or NAME=VALUE after the message.
void Log(LogLevel level, const LogContext& context, const std::string& message,
         const LogFields& fields = {});

// `text` as a JSON string, quotes included; control characters are escaped.
std::string JsonString(const std::string& text);

}  // namespace stellate::server
