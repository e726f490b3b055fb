#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/rpc/handlers.h"

namespace stellate::server {
namespace {

// Room for so many vertices must be left for a mesh to be begun.
constexpr std::uint64_t kFirstVertices = 100;

// What a mesh records before it gets anywhere: its specification, and some answers.
std::uint64_t FirstRecordBytes(const core::Specification& spec) {
  constexpr std::uint64_t kFirst = std::uint64_t{1} << 16;
  return kFirst + static_cast<std::uint64_t>(spec.seeds.size()) * sizeof(double);
}

Clock::duration ToDuration(double seconds) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

void Furnish(ServerState& service, SessionOptions* options) {
  const Config& config = service.config;
  options->dispatch.chunk_bytes = ChunkBytes(config);
  options->dispatch.max_in_flight = config.max_in_flight;
  options->dispatch.check_share = config.check_share;
  options->max_workers = config.max_workers;
  options->max_watchers = config.max_watchers;
  options->observer = service.metrics.observer();
  options->memory = MemoryBudget::Open(service.memory, options->owner);
}

grpc::Status CreateMesh(const Call& call, const v1::CreateMeshRequest& request, v1::Mesh* mesh) {
  ServerState& service = call.service;
  if (service.draining) return ShuttingDown();
  auto parsed = FromProto(request.spec(), service.config);
  if (!parsed) return Refuse(service, parsed.error(), "spec.");

  SessionOptions options;
  options.owner = call.caller.owner;
  options.label = std::move(parsed->label);
  options.spec = std::move(parsed->spec);
  options.dispatch.answer_limit = ToDuration(parsed->answer_seconds);
  options.dispatch.busy_limit = ToDuration(parsed->busy_seconds);
  options.dispatch.worker_wait = ToDuration(parsed->worker_wait_seconds);
  Furnish(service, &options);
  const auto full = options.memory->Set(EstimateMeshBytes(options.spec, kFirstVertices, 0));
  if (full) return Refuse(service, *full);
  if (service.journal != nullptr) {
    const auto no_room =
        service.journal->RefuseNewMesh(options.owner, FirstRecordBytes(options.spec));
    if (no_room) return Refuse(service, *no_room);
  }
  const auto session = service.store.Create(std::move(options));
  if (!session) return Refuse(service, session.error());
  ToProto(**session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
