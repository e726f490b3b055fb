#include "stellate/serve.h"

#include <exception>

#include "net/channel.h"
#include "run/worker.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate {

Expected<MeshState> ServeMesh(Oracle& oracle, const std::string& mesh_name,
                              const ServeOptions& options) {
  if (options.connection.server.empty()) {
    return Fail(ErrorCode::kRefused, "no server is given: say where the mesh is");
  }
  if (const auto ok = client::CheckServable(oracle, options.max_chunk); !ok) {
    return tl::unexpected(ok.error());
  }
  const auto channel = client::Connect(options.connection);
  if (!channel) return tl::unexpected(channel.error());
  const auto stub = v1::Stellate::NewStub(*channel);
  client::Worker worker(*stub, oracle, mesh_name, options.worker,
                        {options.connection.reconnect, *channel,
                         /*hopeless=*/{}, options.connection.on_outage},
                        options.max_chunk);
  {
    const std::stop_callback leave(options.stop, [&worker] { worker.Stop(); });
    worker.Run();
  }
  if (worker.exception()) std::rethrow_exception(worker.exception());
  if (worker.state()) return *worker.state();
  if (options.stop.stop_requested()) {
    return Fail(ErrorCode::kStopped, "this worker left; others have its work");
  }
  if (worker.error()) return tl::unexpected(*worker.error());
  return tl::unexpected(client::BrokenProtocol("the end of the worker's stream too early"));
}

}  // namespace stellate
