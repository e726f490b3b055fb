#include "server/library_log.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>

#include <chrono>
#include <mutex>
#include <string>
#include <utility>

#include "core/message.h"
#include "server/log.h"

namespace stellate::server {
namespace {

constexpr int kLinesASecond = 10;

void Write(LogLevel level, const std::string& line) {
  static std::mutex mutex;
  static std::chrono::steady_clock::time_point second;  // when it began
  static int lines = 0;                                 // in it
  int left_out = 0;
  {
    const std::lock_guard lock(mutex);
    const auto now = std::chrono::steady_clock::now();
    if (now - second >= std::chrono::seconds(1)) {
      second = now;
      left_out = std::exchange(lines, 0) - kLinesASecond;
    }
    if (++lines > kLinesASecond) return;
  }
  if (left_out > 0)
    Log(level, {}, core::Message("libraries: ", left_out, " more lines like these"));
  Log(level, {}, line);
}

// What the libraries call errors is mostly of one connection, not of the server.
void WriteGrpc(gpr_log_func_args* args) {
  const LogLevel level = args->severity == GPR_LOG_SEVERITY_DEBUG  ? LogLevel::kDebug
                         : args->severity == GPR_LOG_SEVERITY_INFO ? LogLevel::kInfo
                                                                   : LogLevel::kWarning;
  Write(level, core::Message("libraries: gRPC: ", args->message));
}

void WriteProtobuf(google::protobuf::LogLevel level, const char*, int, const std::string& message) {
  const bool fatal = level == google::protobuf::LOGLEVEL_FATAL;
  Write(fatal ? LogLevel::kError : LogLevel::kWarning,
        core::Message("libraries: Protocol Buffers: ", message));
}

}  // namespace

void TakeLibraryLogs() {
  gpr_set_log_function(WriteGrpc);
  google::protobuf::SetLogHandler(WriteProtobuf);
}

}  // namespace stellate::server
