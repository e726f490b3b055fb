#include <grpcpp/create_channel.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <thread>
#include <vector>

#include "stellate/v1/stellate.grpc.pb.h"
#include "tests/load/load.h"
#include "tests/load/server_process.h"

namespace stellate::load {
namespace {

using namespace std::chrono_literals;

constexpr char kManifold[] = "torus";
constexpr double kEpsilon = 0.1;

std::unique_ptr<v1::Stellate::Stub> StubFor(const std::string& server) {
  grpc::ChannelArguments arguments;
  arguments.SetInt("grpc.use_local_subchannel_pool", 1);
  arguments.SetMaxReceiveMessageSize(-1);
  return v1::Stellate::NewStub(
      grpc::CreateCustomChannel(server, grpc::InsecureChannelCredentials(), arguments));
}

std::vector<v1::Mesh> List(v1::Stellate::Stub* stub) {
  std::vector<v1::Mesh> all;
  v1::ListMeshesRequest request;
  request.set_page_size(1000);
  do {
    grpc::ClientContext context;
    v1::ListMeshesResponse page;
    if (!stub->ListMeshes(&context, request, &page).ok()) Die("cannot list the meshes");
    all.insert(all.end(), page.meshes().begin(), page.meshes().end());
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return all;
}

// To the end. The number of vertices that the final message tells of, or -1.
long Watch(v1::Stellate::Stub* stub, const std::string& name) {
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto reader = stub->WatchMesh(&context, request);
  v1::WatchMeshResponse event;
  long vertices = 0, told = -1;
  while (reader->Read(&event)) {
    if (event.has_delta()) vertices += event.delta().delta().points().shape(0);
    if (event.has_final()) told = static_cast<long>(event.final().progress().vertices());
  }
  return reader->Finish().ok() && told == vertices ? told : -1;
}

// Watches a mesh and leaves it, so often. False if the server still counts watchers half a minute
// later.
bool ComeAndGo(v1::Stellate::Stub* stub, const std::string& name, int times) {
  for (int i = 0; i < times; ++i) {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    const auto reader = stub->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    if (!reader->Read(&event)) Die("a watch ended: " + reader->Finish().error_message());
    context.TryCancel();
    while (reader->Read(&event)) {
    }
    reader->Finish();
  }
  for (int i = 0; i < 600; ++i) {
    grpc::ClientContext context;
    v1::GetMeshRequest request;
    request.set_name(name);
    v1::Mesh mesh;
    if (!stub->GetMesh(&context, request, &mesh).ok()) Die("the mesh that was watched is gone");
    if (mesh.watchers() == 0) return true;
    std::this_thread::sleep_for(50ms);
  }
  return false;
}

}  // namespace

int Many(int meshes) {
  ServerProcess server({"--max-meshes", std::to_string(meshes + 8), "--keep-finished-meshes",
                        std::to_string(meshes + 8), "--worker-wait", "600"});
  const Mesh reference = MeshOn(server.address(), kManifold, kEpsilon, 1);
  const Stopwatch alone_watch;
  MeshOn(server.address(), kManifold, kEpsilon, 1);
  const double alone = alone_watch.seconds();

  const double processor_before = server.usage().processor_seconds;
  std::atomic<int> same{0}, different{0}, watched{0}, badly{0};
  std::vector<std::jthread> threads;
  const Stopwatch watch;
  for (int i = 0; i < meshes; ++i) {
    threads.emplace_back([&] {
      const Mesh mesh = MeshOn(server.address(), kManifold, kEpsilon, 2);
      ++(AreIdentical(mesh, reference) ? same : different);
    });
  }
  // Each mesh's own client watches it; here comes another for each.
  const auto stub = StubFor(server.address());
  std::vector<std::string> seen;
  std::uint64_t most_workers = 0, most_watchers = 0, most_running = 0;
  std::atomic<bool> over{false};
  std::jthread censor([&] {
    while (!over) {
      std::uint64_t workers = 0, watchers = 0, running = 0;
      for (const v1::Mesh& mesh : List(stub.get())) {
        if (mesh.has_end_time()) continue;
        ++running;
        workers += mesh.workers();
        watchers += mesh.watchers();
        if (std::find(seen.begin(), seen.end(), mesh.name()) != seen.end()) continue;
        seen.push_back(mesh.name());
        threads.emplace_back([&, name = mesh.name()] {
          ++(Watch(StubFor(server.address()).get(), name) == reference.points.cols() ? watched
                                                                                     : badly);
        });
      }
      most_workers = std::max(most_workers, workers);
      most_watchers = std::max(most_watchers, watchers);
      most_running = std::max(most_running, running);
      std::this_thread::sleep_for(50ms);
    }
  });
  while (same + different < meshes) std::this_thread::sleep_for(20ms);
  const double seconds = watch.seconds();
  over = true;
  censor.join();
  threads.clear();
  const ServerProcess::Usage usage = server.usage();
  std::printf("%d meshes of a %s at epsilon %g, %ld vertices each, in %.1f s (one alone: %.2f s)\n",
              meshes, kManifold, kEpsilon, static_cast<long>(reference.points.cols()), seconds,
              alone);
  std::printf("  at once: up to %lu meshes, %lu workers, %lu watchers\n", most_running,
              most_workers, most_watchers);
  std::printf("  bit-identical: %d, different: %d; other watchers: %d complete, %d not\n",
              same.load(), different.load(), watched.load(), badly.load());
  std::printf("  server: %.1f s of processor time, %.0f MB at most, %.0f MB after\n",
              usage.processor_seconds - processor_before, usage.peak_mb, usage.resident_mb);
  const int status = server.Stop();
  if (status != 0) std::printf("  the server left with %d\n", status);
  return different == 0 && badly == 0 && status == 0 ? 0 : 1;
}

int Idle(int meshes) {
  ServerProcess server({"--max-meshes", std::to_string(meshes + 8)});
  const Mesh reference = MeshOn(server.address(), kManifold, kEpsilon, 1);
  const auto stub = StubFor(server.address());
  const ServerProcess::Usage before = server.usage();
  const auto manifold = Make(kManifold);
  std::string watched;
  for (int i = 0; i < meshes; ++i) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    v1::MeshSpec* const spec = request.mutable_spec();
    spec->set_dimension(2);
    spec->set_ambient_dimension(3);
    spec->set_epsilon(kEpsilon);
    const auto box = manifold->bounding_box();
    for (auto [corner, array] :
         {std::pair{&box->lower, spec->mutable_bounding_box()->mutable_lower()},
          std::pair{&box->upper, spec->mutable_bounding_box()->mutable_upper()}}) {
      array->add_shape(3);
      array->set_data(corner->data(), 3 * sizeof(double));
    }
    spec->mutable_limits()->set_worker_wait_seconds(3600);
    v1::Mesh mesh;
    const grpc::Status status = stub->CreateMesh(&context, request, &mesh);
    if (!status.ok()) Die("mesh " + std::to_string(i) + ": " + status.error_message());
    watched = mesh.name();
  }
  const ServerProcess::Usage created = server.usage();
  constexpr auto kQuiet = 10s;
  std::this_thread::sleep_for(kQuiet);
  const ServerProcess::Usage later = server.usage();
  constexpr int kWatches = 1000;
  const bool forgotten = ComeAndGo(stub.get(), watched, kWatches);
  const ServerProcess::Usage after = server.usage();
  const Mesh mesh = MeshOn(server.address(), kManifold, kEpsilon, 1);
  const bool same = AreIdentical(mesh, reference);
  const std::size_t listed = List(stub.get()).size();
  std::printf("%d idle meshes: %.0f kB each, %d threads in all\n", meshes,
              (created.resident_mb - before.resident_mb) * 1024 / meshes, created.threads);
  std::printf("  processor time in %d idle seconds: %.2f s\n", static_cast<int>(kQuiet.count()),
              later.processor_seconds - created.processor_seconds);
  std::printf("  one of them watched and left %d times: %+.1f MB%s\n", kWatches,
              after.resident_mb - later.resident_mb, forgotten ? "" : ", and NOT FORGOTTEN");
  std::printf("  %zu listed; a mesh among them is %s\n", listed,
              same ? "bit-identical" : "DIFFERENT");
  const int status = server.Stop();
  if (status != 0) std::printf("  the server left with %d\n", status);
  return same && forgotten && status == 0 ? 0 : 1;
}

}  // namespace stellate::load
