#pragma once

#include <google/protobuf/descriptor.h>

#include <string>

#include "core/base/message.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::server {

// The mesh that a call's first message names; empty: none, and any server takes the call.
template <typename Request>
std::string MeshNamedIn(const Request& /*request*/) {
  return "";
}
inline std::string MeshNamedIn(const v1::GetMeshRequest& request) { return request.name(); }
inline std::string MeshNamedIn(const v1::CancelMeshRequest& request) { return request.name(); }
inline std::string MeshNamedIn(const v1::DeleteMeshRequest& request) { return request.name(); }
inline std::string MeshNamedIn(const v1::WatchMeshRequest& request) { return request.name(); }
inline std::string MeshNamedIn(const v1::DownloadMeshRequest& request) { return request.name(); }
inline std::string MeshNamedIn(const v1::ServeOracleRequest& request) {
  return request.hello().mesh();
}
inline std::string MeshNamedIn(const v1::PointsChunk& request) { return request.mesh(); }
inline std::string MeshNamedIn(const v1::CreateMeshRequest& request) {
  return request.mesh_id().empty() ? "" : core::Message("meshes/", request.mesh_id());
}

// The path on the wire of the rpc that takes these.
template <typename Request>
const std::string& PathOf() {
  static const std::string path = [] {
    const auto* const service =
        google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(
            "stellate.v1.Stellate");
    for (int i = 0; i < service->method_count(); ++i) {
      const auto* const method = service->method(i);
      if (method->input_type() == Request::descriptor()) {
        return core::Message("/", service->full_name(), "/", method->name());
      }
    }
    return std::string();
  }();
  return path;
}

}  // namespace stellate::server
