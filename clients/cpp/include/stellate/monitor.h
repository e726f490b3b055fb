#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stellate/client.h"
#include "stellate/connection.h"
#include "stellate/error.h"
#include "stellate/report.h"

namespace stellate {

// How far a mesh on a server has come. The last four are its ends.
enum class MeshState {
  kUnknown = 0,
  kWaiting,  // for a worker
  kRunning,
  kSucceeded,
  kStopped,  // a budget was spent, or no progress
  kCancelled,
  kFailed,
};
const char* MeshStateName(MeshState state);  // "WAITING", ...

// A mesh on a server, without its geometry.
struct MeshStatus {
  std::string name;   // "meshes/<id>": who knows it may serve and watch the mesh
  std::string label;  // free text of the client that created it
  std::string owner;  // whose it is, where the token is an administrator's
  MeshState state = MeshState::kUnknown;
  int dimension = 0, ambient_dimension = 0;
  double epsilon = 0;
  Progress progress;
  std::uint64_t revision = 0;
  std::uint32_t workers = 0, watchers = 0;

  bool over() const { return state != MeshState::kWaiting && state != MeshState::kRunning; }
};

// Monitors a server over one connection, which is opened again automatically when it is lost.
//
//   auto monitor = stellate::Monitor::Connect(connection);
//   if (!monitor) return;
//   if (const auto meshes = monitor->Meshes())
//     for (const stellate::MeshStatus& mesh : *meshes)
//       std::cerr << mesh.name << ": " << stellate::MeshStateName(mesh.state) << '\n';
class Monitor {
 public:
  // kRefused: credentials that cannot be used. Whether the server exists shows in the first call.
  static Expected<Monitor> Connect(const Connection& connection);
  Monitor(Monitor&&) noexcept;
  ~Monitor();

  // kServerFailed when none answers within `timeout`.
  Expected<ServerHealth> Health(Seconds timeout = Seconds(5));
  // All meshes that these credentials show, oldest first.
  Expected<std::vector<MeshStatus>> Meshes(Seconds timeout = Seconds(5));
  // Ends a mesh; what is meshed stays readable, unless it is deleted. kRefused: there is none, or
  // it is another's and the token no administrator's.
  Expected<void> Cancel(const std::string& name, Seconds timeout = Seconds(5));
  Expected<void> Delete(const std::string& name, Seconds timeout = Seconds(5));

 private:
  class Impl;
  explicit Monitor(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace stellate
