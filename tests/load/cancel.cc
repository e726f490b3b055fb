// How soon a cancelled mesh ends, and how soon nothing is left of it: meshes of several sizes, each
// cancelled at a moment drawn from the time that an undisturbed one takes. And beside the largest:
// calls with a deadline, and a server that is asked to stop.

#include <grpcpp/create_channel.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "run/worker.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "tests/load/load.h"
#include "tests/load/server_process.h"
#include "wire/convert.h"

namespace stellate::load {
namespace {

constexpr char kManifold[] = "torus";
constexpr double kSoon = 0.1;  // seconds
constexpr double kLargest = 0.0033;

struct Size {
  double epsilon;
  int cancels;
};

// Seconds until the server does nothing any more but wait.
double SecondsOfWork(const ServerProcess& server) {
  constexpr double kQuiet = 0.15;    // seconds
  constexpr double kWaiting = 1e-3;  // seconds of processor time between two looks
  const Stopwatch watch;
  double processor = server.usage().processor_seconds, last = 0;
  while (watch.seconds() < last + kQuiet) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    const double now = server.usage().processor_seconds;
    if (now > processor + kWaiting) last = watch.seconds();
    processor = now;
  }
  return last;
}

// One mesh with a worker, and its end seen through a watch.
class Run {
 public:
  Run(v1::Stellate::Stub& stub, Oracle& oracle, double epsilon) : stub_(stub) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    MeshOptions options;
    options.epsilon = epsilon;
    const auto spec = client::ToSpec(oracle, options);
    if (!spec) Die(spec.error().message);
    *request.mutable_spec() = *spec;
    v1::Mesh mesh;
    const grpc::Status status = stub_.CreateMesh(&context, request, &mesh);
    if (!status.ok()) Die(status.error_message());
    name_ = mesh.name();
    worker_.emplace(stub_, oracle, name_, "cancelled", client::ReconnectPolicy{});
    serving_ = std::jthread([this] { worker_->Run(); });
    watching_ = std::jthread([this] { Watch(); });
  }

  // Deletes it.
  ~Run() {
    grpc::ClientContext context;
    v1::DeleteMeshRequest request;
    request.set_name(name_);
    google::protobuf::Empty empty;
    stub_.DeleteMesh(&context, request, &empty);
    worker_->Stop();  // the server may be gone
  }

  // Seconds that the call took.
  double Cancel() {
    grpc::ClientContext context;
    v1::CancelMeshRequest request;
    request.set_name(name_);
    v1::Mesh mesh;
    const Stopwatch watch;
    const grpc::Status status = stub_.CancelMesh(&context, request, &mesh);
    const double seconds = watch.seconds();
    if (!status.ok()) Die(status.error_message());
    return seconds;
  }

  const std::string& name() const { return name_; }

  // When the server has told how it ended: its place is free for another.
  v1::Mesh AwaitEnd() {
    watching_.join();
    return final_;
  }

 private:
  void Watch() {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name_);
    request.set_progress_only(true);
    const auto reader = stub_.WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    while (reader->Read(&event)) {
      if (event.has_final()) final_ = event.final();
    }
    reader->Finish();
  }

  v1::Stellate::Stub& stub_;
  std::string name_;
  v1::Mesh final_;  // the watching thread's until it is joined
  std::optional<client::Worker> worker_;
  std::jthread serving_, watching_;
};

void Print(const char* what, std::vector<double> seconds) {
  std::sort(seconds.begin(), seconds.end());
  const auto at = [&](double share) {
    return 1e3 * seconds[static_cast<std::size_t>(share * static_cast<double>(seconds.size() - 1))];
  };
  const auto late =
      std::count_if(seconds.begin(), seconds.end(), [](double s) { return s > kSoon; });
  std::printf(
      "    %-18s median %6.1f ms, nine in ten %6.1f ms, worst %6.1f ms; %ld beyond %.0f ms\n", what,
      at(0.5), at(0.9), at(1), static_cast<long>(late), 1e3 * kSoon);
}

// The number of meshes that ended in another way than they should.
int CancelAt(const ServerProcess& server, v1::Stellate::Stub& stub, Oracle& oracle,
             const Size& size, std::mt19937_64& random, double* undisturbed) {
  const Stopwatch whole_watch;
  const v1::Mesh whole = Run(stub, oracle, size.epsilon).AwaitEnd();
  const double whole_seconds = *undisturbed = whole_watch.seconds();
  std::printf("  %lu vertices, %.2f s undisturbed; cancelled %d times\n",
              static_cast<unsigned long>(whole.progress().vertices()), whole_seconds, size.cancels);
  std::uniform_real_distribution<double> moment(0, whole_seconds);
  std::vector<double> returned, told, processor, worked;
  int too_late = 0, wrong = whole.state() == v1::MESH_STATE_SUCCEEDED ? 0 : 1;
  for (int i = 0; i < size.cancels; ++i) {
    Run run(stub, oracle, size.epsilon);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment(random)));
    const double processor_before = server.usage().processor_seconds;
    const Stopwatch watch;
    const double seconds = run.Cancel();
    const v1::MeshState state = run.AwaitEnd().state();
    if (state == v1::MESH_STATE_CANCELLED) {
      returned.push_back(seconds);
      told.push_back(watch.seconds());
      worked.push_back(told.back() + SecondsOfWork(server));
      processor.push_back(server.usage().processor_seconds - processor_before);
    } else {
      ++(state == v1::MESH_STATE_SUCCEEDED ? too_late : wrong);
    }
  }
  if (too_late > 0) std::printf("    %d were over before\n", too_late);
  if (!told.empty()) {
    Print("the call returns", returned);
    Print("the end is told", told);
    Print("no work is left", worked);
    Print("its processor time", processor);  // which other programs do not lengthen
  }
  std::fflush(stdout);
  return wrong;
}

std::chrono::system_clock::time_point Soon() {
  return std::chrono::system_clock::now() + std::chrono::duration_cast<std::chrono::milliseconds>(
                                                std::chrono::duration<double>(kSoon));
}

// Reads a stream about a mesh, with a deadline, until it ends. Adds by how much it was late, if it
// was its deadline that ended it.
template <typename Request, typename Response>
void ReadUntilLate(v1::Stellate::Stub& stub, const std::string& name,
                   std::unique_ptr<grpc::ClientReader<Response>> (v1::Stellate::Stub::*call)(
                       grpc::ClientContext*, const Request&),
                   std::vector<double>* late) {
  grpc::ClientContext context;
  context.set_deadline(Soon());
  Request request;
  request.set_name(name);
  const Stopwatch watch;
  const auto reader = (stub.*call)(&context, request);
  for (Response response; reader->Read(&response);) {
  }
  if (reader->Finish().error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    late->push_back(watch.seconds() - kSoon);
  }
}

// Calls about a mesh that is being computed, each with a deadline: how long they take.
int KeepDeadlines(v1::Stellate::Stub& stub, Oracle& oracle) {
  std::printf("  while one of the largest is computed, calls whose deadline is after %.0f ms\n",
              1e3 * kSoon);
  Run run(stub, oracle, kLargest);
  std::vector<double> got, watched, downloaded;
  int wrong = 0;
  for (v1::Mesh mesh; !mesh.has_report();) {
    grpc::ClientContext context;
    context.set_deadline(Soon());
    v1::GetMeshRequest request;
    request.set_name(run.name());
    const Stopwatch watch;
    wrong += !stub.GetMesh(&context, request, &mesh).ok();
    got.push_back(watch.seconds());
    ReadUntilLate(stub, run.name(), &v1::Stellate::Stub::WatchMesh, &watched);
    ReadUntilLate(stub, run.name(), &v1::Stellate::Stub::DownloadMesh, &downloaded);
  }
  run.AwaitEnd();
  Print("GetMesh returns", got);
  if (!watched.empty()) Print("WatchMesh after it", watched);
  if (!downloaded.empty()) Print("DownloadMesh, too", downloaded);
  std::fflush(stdout);
  return wrong;
}

// A server that is asked to stop, and to wait for no mesh, while it computes one.
int StopAt(Oracle& oracle, double whole_seconds, int stops, bool durable, std::mt19937_64& random) {
  std::printf("  the server asked to stop %d times while it computes one of the largest\n", stops);
  std::uniform_real_distribution<double> moment(0, whole_seconds);
  std::vector<double> gone;
  int wrong = 0;
  for (int i = 0; i < stops; ++i) {
    ServerProcess server({"--drain-seconds", "0"}, durable);
    const auto stub = v1::Stellate::NewStub(
        grpc::CreateChannel(server.address(), grpc::InsecureChannelCredentials()));
    Run run(*stub, oracle, kLargest);
    std::this_thread::sleep_for(std::chrono::duration<double>(moment(random)));
    const Stopwatch watch;
    wrong += server.Stop() != 0;
    gone.push_back(watch.seconds());
  }
  Print("the process is gone", gone);
  std::fflush(stdout);
  return wrong;
}

}  // namespace

int Cancel(int cancels, bool durable) {
  ServerProcess server({}, durable);
  const auto stub = v1::Stellate::NewStub(
      grpc::CreateChannel(server.address(), grpc::InsecureChannelCredentials()));
  const auto oracle = Make(kManifold);
  std::mt19937_64 random(1);
  std::printf("a %s, cancelled at random moments%s\n", kManifold,
              durable ? ", by a server with a data directory" : "");
  int wrong = 0;
  double whole_seconds = 0;  // of the largest
  for (const Size& size : {Size{0.033, cancels}, Size{0.0105, (cancels + 1) / 2},
                           Size{kLargest, (3 * cancels + 9) / 10}}) {
    wrong += CancelAt(server, *stub, *oracle, size, random, &whole_seconds);
  }
  wrong += KeepDeadlines(*stub, *oracle);
  wrong += StopAt(*oracle, whole_seconds, (cancels + 9) / 10, durable, random);
  if (wrong > 0) std::printf("  %d ended in another way than they should\n", wrong);
  const int status = server.Stop();
  if (status != 0) std::printf("  the server left with %d\n", status);
  return wrong == 0 && status == 0 ? 0 : 1;
}

}  // namespace stellate::load
