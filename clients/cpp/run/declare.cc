#include "run/declare.h"

#include <chrono>
#include <cstdio>
#include <random>
#include <stop_token>
#include <utility>

#include "net/channel.h"
#include "run/check.h"
#include "run/scaled.h"
#include "stellate/serve.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate {
namespace client {
namespace {

// 128 random bits in hexadecimal.
std::string RandomId() {
  std::random_device random;
  std::string id;
  for (int word = 0; word < 4; ++word) {
    char digits[9];
    std::snprintf(digits, sizeof digits, "%08x", random());
    id += digits;
  }
  return id;
}

// Whether there is a server, once that is known: as the first call would find out.
bool Reaches(grpc::Channel* channel) {
  const auto deadline = std::chrono::system_clock::now() + kCallTime;
  while (channel != nullptr) {
    const grpc_connectivity_state state = channel->GetState(/*try_to_connect=*/true);
    if (state == GRPC_CHANNEL_READY) return true;
    if (state == GRPC_CHANNEL_TRANSIENT_FAILURE || state == GRPC_CHANNEL_SHUTDOWN) return false;
    if (!channel->WaitForStateChange(state, deadline)) return false;
  }
  return false;
}

}  // namespace

Expected<Request> Settle(const Host& host, Oracle& oracle, const MeshOptions& options) {
  Request request{options, ""};
  if (!options.epsilon.length()) {
    CheckOptions check;
    check.stop = options.stop;
    Expected<ChosenEpsilon> chosen = ChooseEpsilonOn(host, oracle, check);
    if (!chosen) return tl::unexpected(chosen.error());
    Take(*chosen, &request);
  }
  // Round trips are what a far server costs.
  const bool far =
      !options.connection.server.empty() && !StaysOnThisMachine(options.connection.server);
  if (!options.speculative && far) request.options.speculative = true;
  return request;
}

void Take(const ChosenEpsilon& chosen, Request* request) {
  request->options.epsilon = chosen.epsilon;
  request->epsilon_reason = chosen.reason;
  if (request->options.on_epsilon) request->options.on_epsilon(chosen.epsilon, chosen.reason);
}

void Tell(const std::string& epsilon_reason, Report* report) {
  if (epsilon_reason.empty()) return;
  char epsilon[32];
  std::snprintf(epsilon, sizeof epsilon, "%g", report->epsilon);
  report->epsilon_reason = epsilon_reason;
  report->text += std::string("      epsilon  ") + epsilon + ", " + epsilon_reason + "\n";
}

Expected<v1::Mesh> CreateMesh(v1::Stellate::Stub& stub, Oracle& oracle, const MeshOptions& options,
                              const ReconnectPolicy& policy) {
  const Expected<v1::MeshSpec> spec = ToSpec(oracle, options);
  if (!spec) return tl::unexpected(spec.error());
  v1::CreateMeshRequest request;
  *request.mutable_spec() = *spec;
  request.set_mesh_id(RandomId());
  const bool is_there = Reaches(policy.channel.get());
  Reconnector attempts(policy);
  // What the attempt under way makes is wanted: it is cancelled by its name.
  const std::stop_callback finish(options.stop, [&attempts] { attempts.Finish(); });
  while (true) {
    grpc::ClientContext& context = attempts.Attempt();
    context.set_deadline(std::chrono::system_clock::now() + kCallTime);
    v1::Mesh mesh;
    const grpc::Status status = stub.CreateMesh(&context, request, &mesh);
    if (status.ok()) {
      attempts.Heard();
      return mesh;
    }
    if (!is_there) return tl::unexpected(FromStatus(status));
    if (!attempts.Again(status)) return tl::unexpected(attempts.Lost(status));
  }
}

}  // namespace client

Expected<std::string> DeclareMesh(Oracle& oracle, const MeshOptions& options) {
  if (options.connection.server.empty()) {
    return Fail(ErrorCode::kRefused, "no server is given: say where the mesh is to be");
  }
  const Expected<std::shared_ptr<Oracle>> scaled = client::Scaled(oracle, options);
  if (!scaled) return tl::unexpected(scaled.error());
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  const Expected<client::Request> request = client::Settle(*host, **scaled, options);
  if (!request) return tl::unexpected(request.error());
  const auto mesh =
      client::CreateMesh(*v1::Stellate::NewStub(host->channel), **scaled, request->options,
                         {options.connection.reconnect, host->channel, host->IsHopeless(),
                          options.connection.on_outage});
  if (!mesh) return tl::unexpected(mesh.error());
  return mesh->name();
}

}  // namespace stellate
