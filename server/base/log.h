#pragma once

#include <cstdint>
#include <string>

#include "server/base/log_fields.h"

namespace stellate::server {

enum class LogLevel { kTrace, kDebug, kInfo, kWarning, kError, kOff };
enum class LogFormat { kText, kJson };

// Starts logging to stderr. Before it, and in tests, nothing is logged below warnings.
void StartLogging(LogLevel level, LogFormat format);

// From now on. Any thread.
void SetLogLevel(LogLevel level);

// What a line is about; `mesh` empty when it is about the server.
struct LogContext {
  std::string mesh;
  std::uint64_t round = 0;
  std::string owner = {};  // the mesh's: lines are rationed by it, and do not show it
};

bool LogEnabled(LogLevel level);
// One line, with the mesh's name and round. JSON: an object with time, level, mesh, round, message.
// The fields follow: as members of the object, or NAME=VALUE after the message. The line is made
// text::Printable. Lines of kInfo and above are rationed, as clients cause them: each owner's
// meshes, and the server itself, have a burst of a hundred lines and ten a second; what is beyond
// is counted.
void Log(LogLevel level, const LogContext& context, const std::string& message,
         const LogFields& fields = {});
// The same for what a library says, all of them together.
void LogLibrary(LogLevel level, const std::string& message);
// Logs how many lines were left out since this was last called. To be called about once a second.
void LogLeftOut();

// `text` as a JSON string, quotes included; control characters are escaped.
std::string JsonString(const std::string& text);

}  // namespace stellate::server
