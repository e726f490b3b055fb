#include "server/base/version.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {

grpc::Status GetServerInfo(const Call& call, const v1::GetServerInfoRequest&,
                           v1::ServerInfo* info) {
  const std::shared_ptr<const Config> config = call.state.config();
  info->set_version(Version());
  info->add_protocols("stellate.v1");
  info->set_max_dimension(static_cast<std::uint32_t>(config->max_dimension));
  info->set_max_ambient_dimension(static_cast<std::uint32_t>(config->max_ambient_dimension));
  info->set_max_vertices(config->max_vertices);
  info->set_max_rounds(config->max_rounds);
  info->set_max_meshes(static_cast<std::uint32_t>(config->max_meshes));
  info->set_max_message_bytes(config->max_message_bytes);
  info->set_owner_meshes(static_cast<std::uint32_t>(config->owner_meshes));
  info->set_max_memory_bytes(config->max_memory_bytes);
  info->set_owner_memory_bytes(config->owner_memory_bytes);
  info->set_max_workers(static_cast<std::uint32_t>(config->max_workers));
  info->set_max_watchers(static_cast<std::uint32_t>(config->max_watchers));
  info->set_check_share(config->check_share);
  return grpc::Status::OK;
}

}  // namespace stellate::server
