#pragma once

#include <grpcpp/channel.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "net/reconnect.h"
#include "run/delta_mesh.h"
#include "run/worker.h"
#include "stellate/client.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

// One mesh on one server, from its creation to its end. Lost streams are opened again and carried
// on: the watch from the last revision that it has, the workers with whatever is asked next.
class Run {
 public:
  enum class Watching { kMesh, kProgress };
  // `hopeless`: whether a lost server will not come back.
  Run(const std::shared_ptr<grpc::Channel>& channel, Oracle& oracle, const MeshOptions& options,
      std::function<bool()> hopeless, Watching watching = Watching::kMesh);
  // Whatever happens the mesh is gone from the server, and no thread is left in the oracle.
  ~Run();

  // Of kProgress the report alone.
  Expected<Mesh> Go();
  // Fetches the mesh, which Go has seen the end of, into files.
  Expected<SavedMesh> SaveTo(const std::vector<std::string>& paths) const;

 private:
  Expected<void> Create();
  void StartWorkers();
  void WorkerEnded(const Worker& worker);
  void JoinWorkers();
  void Cancel();
  Expected<Mesh> Watch();
  Expected<void> WatchOnce(v1::Mesh* final, grpc::Status* status);
  Expected<Mesh> Conclude(const v1::Mesh& final);
  Error LostFor(const grpc::Status& status) const;
  ReconnectPolicy Policy() const;

  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::Stellate::Stub> stub_;
  Oracle& oracle_;
  const MeshOptions& options_;
  const std::function<bool()> hopeless_;
  const Watching watching_;
  std::string name_;
  std::unique_ptr<DeltaMesh> builder_;  // of kMesh
  std::unique_ptr<Reconnector> watch_;
  bool ended_ = false;  // the server said how
  std::vector<std::unique_ptr<Worker>> workers_;
  std::vector<std::thread> threads_;
  std::mutex mutex_;
  size_t ended_workers_ = 0;
  bool given_up_ = false;  // the last worker lost the server
};

}  // namespace stellate::client
