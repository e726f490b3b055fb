#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/error_map.h"
#include "server/handlers/handlers.h"

namespace stellate::server {
namespace {

Clock::duration ToDuration(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

grpc::Status CreateMesh(const Call& call, const v1::CreateMeshRequest& request, v1::Mesh* mesh) {
  ServerState& service = call.service;
  if (service.draining) return ShuttingDown();
  auto parsed = FromProto(request.spec(), service.config);
  if (!parsed) return ToGrpc(parsed.error(), "spec.");

  SessionOptions options;
  options.owner = call.caller.owner;
  options.observer = service.metrics.observer();
  options.label = std::move(parsed->label);
  options.spec = std::move(parsed->spec);
  options.dispatch.answer_limit = ToDuration(parsed->answer_seconds);
  options.dispatch.worker_wait = ToDuration(parsed->worker_wait_seconds);
  options.dispatch.chunk_bytes = ChunkBytes(service.config);
  options.max_workers = service.config.max_workers;
  options.max_watchers = service.config.max_watchers;
  const auto session = service.store.Create(std::move(options));
  if (!session) return ToGrpc(session.error());
  ToProto(**session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
