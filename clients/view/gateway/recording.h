#pragma once

#include <functional>
#include <stop_token>
#include <string>

#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::view {

struct RecordOptions {
  Connection connection;
  std::function<void(const Progress&)> on_progress;  // while the mesh is waited for
  std::stop_token stop;
};

// Writes a finished mesh as one file that shows it, without a server: the viewer's page with all
// that it would ask for, in the messages that this server gave. One that grows is waited for. Of
// earlier revisions, evenly, as many as take no more room than the mesh, or 1.2 MB; at most 16 MB.
Expected<void> WriteRecording(const std::string& mesh, const std::string& path,
                              const RecordOptions& options);

}  // namespace stellate::view
