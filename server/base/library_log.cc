#include "server/base/library_log.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>

#include <string>

#include "core/base/message.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

// What the libraries call errors is mostly of one connection, not of the server.
void WriteGrpc(gpr_log_func_args* args) {
  const LogLevel level = args->severity == GPR_LOG_SEVERITY_DEBUG  ? LogLevel::kDebug
                         : args->severity == GPR_LOG_SEVERITY_INFO ? LogLevel::kInfo
                                                                   : LogLevel::kWarning;
  LogLibrary(level, core::Message("gRPC: ", args->message));
}

void WriteProtobuf(google::protobuf::LogLevel level, const char*, int, const std::string& message) {
  const bool fatal = level == google::protobuf::LOGLEVEL_FATAL;
  LogLibrary(fatal ? LogLevel::kError : LogLevel::kWarning,
             core::Message("Protocol Buffers: ", message));
}

}  // namespace

void TakeLibraryLogs() {
  gpr_set_log_function(WriteGrpc);
  google::protobuf::SetLogHandler(WriteProtobuf);
}

}  // namespace stellate::server
