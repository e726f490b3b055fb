#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>
#include <vector>

#include "stellate/download.h"

namespace stellate::client {

// DownloadMeshTo over a channel that is there; options.connection.server is not read.
Expected<SavedMesh> DownloadTo(const std::shared_ptr<grpc::Channel>& channel,
                               const std::string& name, const std::vector<std::string>& paths,
                               const DownloadOptions& options);

}  // namespace stellate::client
