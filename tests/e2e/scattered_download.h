#pragma once

#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stellate/download.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::testing {

// A hexagon in the plane, sent a row at a time.
class Scattered final : public v1::Stellate::Service {
 public:
  bool in_order = false;   // and oriented
  bool has_wall = false;   // with the first vertex on it
  std::deque<int> breaks;  // after so many parts each stream in turn is broken off
  grpc::Status with{grpc::StatusCode::UNAVAILABLE, "broken by the test"};
  std::vector<std::pair<std::uint64_t, std::uint64_t>> asked;  // revision, position
  std::function<void(v1::DownloadMeshResponse*)> spoil;

  grpc::Status GetMesh(grpc::ServerContext*, const v1::GetMeshRequest* request,
                       v1::Mesh* mesh) override {
    mesh->set_name(request->name());
    mesh->set_state(v1::MESH_STATE_SUCCEEDED);
    mesh->set_revision(7);
    mesh->mutable_spec()->set_dimension(1);
    mesh->mutable_spec()->set_ambient_dimension(2);
    mesh->mutable_spec()->set_walls(has_wall ? 1 : 0);
    mesh->mutable_report()->set_termination(v1::TERMINATION_CONVERGED);
    mesh->mutable_end_time()->set_seconds(1);
    return grpc::Status::OK;
  }

  grpc::Status DownloadMesh(grpc::ServerContext*, const v1::DownloadMeshRequest* request,
                            grpc::ServerWriter<v1::DownloadMeshResponse>* writer) override {
    asked.emplace_back(request->revision(), request->position());
    int sent = 0;
    for (std::uint64_t position = request->position(); position < 12; ++position, ++sent) {
      if (!breaks.empty() && breaks.front() == sent) {
        breaks.pop_front();
        return with;
      }
      v1::DownloadMeshResponse part = Part(position);
      if (spoil) spoil(&part);
      writer->Write(part);
    }
    return grpc::Status::OK;
  }

 private:
  v1::DownloadMeshResponse Part(std::uint64_t position) const {
    v1::DownloadMeshResponse part;
    part.set_revision(7);
    part.set_vertices(6);
    part.set_simplices(6);
    part.set_first_vertex(std::min<std::uint64_t>(position, 6));
    if (position < 6) {
      const double point[] = {static_cast<double>(position), 0.5};
      part.mutable_points()->add_shape(1);
      part.mutable_points()->add_shape(2);
      part.mutable_points()->set_data(point, sizeof point);
      if (has_wall && position == 0) {
        part.add_boundary_vertices(0);
        part.add_boundary_walls(1);
      }
    } else {
      const auto i = static_cast<std::uint32_t>(11 - position);  // not in order
      const std::uint32_t sorted[][2] = {{0, 1}, {0, 5}, {1, 2}, {2, 3}, {3, 4}, {4, 5}};
      const std::uint32_t* const next = sorted[position - 6];
      std::uint32_t cell[] = {i == 5 ? 0 : i, i == 5 ? 5 : i + 1};
      if (in_order) {
        std::copy_n(next, 2, cell);
        part.mutable_orientation()->set_orientable(true);
        part.mutable_orientation()->set_turned(position == 7 ? "\1" : std::string(1, '\0'));
      }
      part.mutable_cells()->add_shape(1);
      part.mutable_cells()->add_shape(2);
      part.mutable_cells()->set_data(cell, sizeof cell);
    }
    part.set_next_position(position + 1);
    part.set_complete(position == 11);
    return part;
  }
};

// Downloads that break off, from a server that sends that hexagon.
class BrokenDownload : public ::testing::Test {
 protected:
  BrokenDownload() {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&fake_);
    server_ = builder.BuildAndStart();
    options_.connection.server = "127.0.0.1:" + std::to_string(port);
    options_.connection.on_outage = [this](const Outage& outage) {
      outages_ += outage.over ? 0 : 1;
    };
  }
  Expected<Mesh> Fetch() { return DownloadMesh("meshes/x", options_); }

  Scattered fake_;
  std::unique_ptr<grpc::Server> server_;
  DownloadOptions options_;
  int outages_ = 0;
};

}  // namespace stellate::testing
