#include "demo.h"

#include <grpcpp/client_context.h>

#include <array>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "net/channel.h"
#include "net/embedded_server.h"
#include "stellate/catalogue.h"
#include "stellate/serve.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::view {
namespace {

// Of what can be looked at: fine enough to please, coarse enough to see the triangles.
struct Exhibit {
  const char* manifold;
  double epsilon;
};
constexpr std::array kExhibits = {
    Exhibit{"torus:1:0.4", 0.04},
    Exhibit{"tanglecube", 0.1},
    Exhibit{"clifford-torus", 0.06},
    Exhibit{"two-spheres", 0.08},
    Exhibit{"ellipsoid:1:0.7:0.5", 0.05},
    Exhibit{"torus-knot:2:3", 0.03},
    Exhibit{"so3", 0.35},
    Exhibit{"rp2:5", 0.08},
    Exhibit{"flat-torus:3", 0.35},
    Exhibit{"sphere:3", 0.25},
};
constexpr auto kPause = std::chrono::seconds(4);  // to look at the certificate

}  // namespace

class Demo::Impl {
 public:
  Expected<void> Start() {
    auto server = client::EmbeddedServer::Start();
    if (!server) return tl::unexpected(server.error());
    server_ = std::move(*server);
    const auto channel = client::Connect({server_->address()});
    if (!channel) return tl::unexpected(channel.error());
    stub_ = v1::Stellate::NewStub(*channel);
    return {};
  }

  const std::string& server() const { return server_->address(); }

  // The mesh's name.
  Expected<std::string> Declare(Oracle& oracle, const Exhibit& exhibit) {
    MeshOptions options;
    options.epsilon = exhibit.epsilon;
    options.label = exhibit.manifold;
    const Expected<v1::MeshSpec> spec = client::ToSpec(oracle, options);
    if (!spec) return tl::unexpected(spec.error());
    v1::CreateMeshRequest request;
    *request.mutable_spec() = *spec;
    grpc::ClientContext context;
    v1::Mesh mesh;
    const grpc::Status status = stub_->CreateMesh(&context, request, &mesh);
    if (!status.ok()) return tl::unexpected(client::FromStatus(status));
    return mesh.name();
  }

  Expected<void> Show(const Exhibit& exhibit, const std::stop_token& stop) {
    const auto manifold = MakeManifold(exhibit.manifold);
    if (!manifold) return tl::unexpected(manifold.error());
    const Expected<std::string> name = Declare(**manifold, exhibit);
    if (!name) return tl::unexpected(name.error());
    ServeOptions options;
    options.connection.server = server();
    options.worker = "stellate view --demo";
    options.stop = stop;
    const Expected<MeshState> state = ServeMesh(**manifold, *name, options);
    if (!state && !stop.stop_requested()) return tl::unexpected(state.error());
    return {};
  }

 private:
  std::unique_ptr<client::EmbeddedServer> server_;
  std::unique_ptr<v1::Stellate::Stub> stub_;
};

Demo::Demo(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Demo::~Demo() = default;

Expected<std::unique_ptr<Demo>> Demo::Start() {
  auto impl = std::make_unique<Impl>();
  if (const auto ok = impl->Start(); !ok) return tl::unexpected(ok.error());
  return std::unique_ptr<Demo>(new Demo(std::move(impl)));
}

const std::string& Demo::server() const { return impl_->server(); }

Expected<void> Demo::Run(const std::stop_token& stop,
                         const std::function<void(const std::string& manifold)>& on_mesh) {
  std::mutex mutex;
  std::condition_variable_any wake;
  for (const Exhibit& exhibit : kExhibits) {
    if (stop.stop_requested()) break;
    on_mesh(exhibit.manifold);
    if (auto ok = impl_->Show(exhibit, stop); !ok) return ok;
    std::unique_lock lock(mutex);
    wake.wait_for(lock, stop, kPause, [] { return false; });
  }
  return {};
}

}  // namespace stellate::view
