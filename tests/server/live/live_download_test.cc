// Reading a mesh in parts, and watching one that is not as it was.

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <limits>
#include <set>
#include <vector>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;

struct Part {
  std::uint64_t revision = 0, vertices = 0, simplices = 0, next = 0;
  std::string points, cells;  // as they travel
  bool complete = false;
};

class LiveDownloadTest : public LiveServer {
 protected:
  // Reads to the end into `part`, from where it stands.
  grpc::Status Download(const std::string& name, Part* part) {
    grpc::ClientContext context;
    v1::DownloadMeshRequest request;
    request.set_name(name);
    request.set_revision(part->revision);
    request.set_position(part->next);
    const auto reader = stub_->DownloadMesh(&context, request);
    v1::DownloadMeshResponse message;
    while (reader->Read(&message)) {
      EXPECT_FALSE(part->complete) << "nothing follows the end";
      EXPECT_EQ(message.first_vertex(), std::min(part->next, message.vertices()));
      part->points += message.points().data();
      part->cells += message.cells().data();
      const bool is_last = message.revision() == Get(name).revision();
      EXPECT_TRUE(is_last || !message.has_orientation()) << "of an earlier revision";
      part->revision = message.revision();
      part->vertices = message.vertices();
      part->simplices = message.simplices();
      part->next = message.next_position();
      part->complete = message.complete();
    }
    return reader->Finish();
  }

  static void ExpectWhole(const Part& part) {
    EXPECT_TRUE(part.complete);
    EXPECT_EQ(part.points.size(), part.vertices * 24);
    EXPECT_EQ(part.cells.size(), part.simplices * 12);
  }

  std::string MeshSphere(double epsilon) {
    const std::string name = CreateSphere(epsilon);
    RawWorker worker(stub_.get(), name);
    EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
    return name;
  }
};

TEST_F(LiveDownloadTest, AMeshIsReadWholeOrResumedAnywhere) {
  Start();
  const std::string name = MeshSphere(0.1);
  Part whole;
  EXPECT_TRUE(Download(name, &whole).ok());
  ExpectWhole(whole);
  const v1::Mesh mesh = Get(name);
  EXPECT_EQ(whole.revision, mesh.revision());
  EXPECT_EQ(whole.vertices, mesh.report().counts().vertices());
  EXPECT_EQ(whole.simplices, mesh.report().counts().simplices());

  // Rows come sorted, at positions after those of the order that they had before the mesh ended.
  for (const std::uint64_t position :
       {std::uint64_t{1}, whole.vertices - 1, whole.vertices, whole.next - whole.simplices + 1,
        whole.next - whole.simplices / 2, whole.next - 1, whole.next}) {
    Part rest;
    rest.revision = whole.revision;
    rest.next = position;
    EXPECT_TRUE(Download(name, &rest).ok());
    EXPECT_TRUE(rest.complete);
    EXPECT_EQ(rest.next, whole.next);
    EXPECT_EQ(rest.points, whole.points.substr(24 * std::min(position, whole.vertices)));
    EXPECT_TRUE(whole.cells.ends_with(rest.cells));
    EXPECT_TRUE(position > whole.vertices || rest.cells == whole.cells);
  }
}

std::multiset<std::string> RowsOf(const std::string& cells) {
  std::multiset<std::string> rows;
  for (std::size_t i = 0; i < cells.size(); i += 12) rows.insert(cells.substr(i, 12));
  return rows;
}

TEST_F(LiveDownloadTest, OneThatWasBegunBeforeTheEndGoesOnInItsOrder) {
  Start();
  const std::string name = MeshSphere(0.1);
  Part whole;
  EXPECT_TRUE(Download(name, &whole).ok());
  const std::multiset<std::string> all = RowsOf(whole.cells);
  const std::uint64_t end = whole.next - whole.simplices;
  for (const std::uint64_t position :
       {whole.vertices + 1, (whole.vertices + end) / 2, end - 1, end}) {
    Part rest;
    rest.revision = whole.revision;
    rest.next = position;
    EXPECT_TRUE(Download(name, &rest).ok());
    EXPECT_TRUE(rest.complete);
    EXPECT_EQ(rest.next, end);
    const std::multiset<std::string> rows = RowsOf(rest.cells);
    EXPECT_TRUE(std::includes(all.begin(), all.end(), rows.begin(), rows.end()));
    EXPECT_GE(rows.size() + (position - whole.vertices), all.size());
  }
}

// The triangles of the whole mesh, as its Orientation turns them.
using Oriented = std::set<std::array<std::uint32_t, 3>>;
void Turn(const std::string& rows, const std::string& turned, Oriented* oriented) {
  for (std::size_t i = 0; 12 * i < rows.size(); ++i) {
    std::array<std::uint32_t, 3> row;
    std::memcpy(row.data(), rows.data() + 12 * i, 12);
    const auto byte = static_cast<unsigned char>(turned.at(i / 8));
    if ((byte >> (i % 8) & 1) != 0) std::swap(row[1], row[2]);
    oriented->insert(row);
  }
}

// That downloads and watches tell the same, and that it is right: normals of the sphere, seen from
// its centre, point outwards.
TEST_F(LiveDownloadTest, AMeshThatIsOverComesWithItsOrientation) {
  Start();
  const std::string name = MeshSphere(0.1);
  Oriented downloaded;
  std::vector<double> points;
  {
    grpc::ClientContext context;
    v1::DownloadMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->DownloadMesh(&context, request);
    v1::DownloadMeshResponse part;
    while (reader->Read(&part)) {
      const std::size_t known = points.size();
      points.resize(known + part.points().data().size() / 8);
      std::memcpy(points.data() + known, part.points().data().data(), part.points().data().size());
      if (part.cells().data().empty()) continue;
      ASSERT_TRUE(part.orientation().orientable());
      Turn(part.cells().data(), part.orientation().turned(), &downloaded);
    }
    EXPECT_TRUE(reader->Finish().ok());
  }
  EXPECT_EQ(downloaded.size(), Get(name).report().counts().simplices());
  for (const auto& row : downloaded) {
    Eigen::Matrix3d corners;
    for (int i = 0; i < 3; ++i) corners.col(i) = Eigen::Map<Eigen::Vector3d>(&points[3 * row[i]]);
    ASSERT_GT(corners.determinant(), 0);
  }

  Oriented sorted, watched;
  for (auto row : downloaded) {
    std::sort(row.begin(), row.end());
    sorted.insert(row);
  }
  std::string rows, turned;
  for (const auto& row : sorted) rows.append(reinterpret_cast<const char*>(row.data()), 12);
  for (const bool progress_only : {false, true}) {
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    request.set_progress_only(progress_only);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    while (reader->Read(&event)) {
      EXPECT_TRUE(!event.has_delta() || turned.empty()) << "after the last delta";
      if (!event.has_orientation()) continue;
      EXPECT_FALSE(progress_only);
      EXPECT_EQ(event.orientation().first_simplex(), 8 * turned.size());
      turned += event.orientation().turned();
    }
    EXPECT_TRUE(event.has_final());
    EXPECT_TRUE(reader->Finish().ok());
  }
  Turn(rows, turned, &watched);
  EXPECT_EQ(watched, downloaded);
}

TEST_F(LiveDownloadTest, AnEarlierRevisionCanStillBeRead) {
  Start();
  const std::string name = MeshSphere(0.1);
  Part before;
  for (std::uint64_t revision = 1; revision <= Get(name).revision(); ++revision) {
    Part part;
    part.revision = revision;
    EXPECT_TRUE(Download(name, &part).ok());
    ExpectWhole(part);
    EXPECT_EQ(part.revision, revision);
    EXPECT_TRUE(part.points.starts_with(before.points)) << "vertices stay";
    before = part;
  }
  EXPECT_EQ(before.vertices, Get(name).report().counts().vertices());
}

TEST_F(LiveDownloadTest, ARunningMeshCanBeRead) {
  Start();
  const std::string name = CreateSphere();
  Part empty;
  EXPECT_TRUE(Download(name, &empty).ok());
  ExpectWhole(empty);
  EXPECT_EQ(empty.vertices, 0u);
}

TEST_F(LiveDownloadTest, WhatIsNotThereIsRefused) {
  Start();
  const std::string name = MeshSphere(0.3);
  Part whole;
  ASSERT_TRUE(Download(name, &whole).ok());
  Part part;
  part.revision = 1000;
  grpc::Status status = Download(name, &part);
  EXPECT_EQ(status.error_code(), StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(ReasonIn(status), "REVISION_TOO_NEW");
  for (const auto& [revision, position] :
       {std::pair<std::uint64_t, std::uint64_t>{0, 1},
        {whole.revision, whole.next + 1},
        {whole.revision, std::numeric_limits<std::uint64_t>::max()}}) {
    Part odd;
    odd.revision = revision;
    odd.next = position;
    status = Download(name, &odd);
    EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(FieldIn(status), "position");
  }
  EXPECT_EQ(Download("meshes/00000000000000000000000000000000", &part).error_code(),
            StatusCode::NOT_FOUND);
}

TEST_F(LiveDownloadTest, ADownloadCountsAsAWatcher) {
  Config config;
  config.max_watchers = 1;
  Start(config);
  const std::string name = CreateSphere();
  grpc::ClientContext context;
  v1::WatchMeshRequest request;
  request.set_name(name);
  const auto reader = stub_->WatchMesh(&context, request);
  v1::WatchMeshResponse event;
  ASSERT_TRUE(reader->Read(&event));
  Part part;
  const grpc::Status status = Download(name, &part);
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(LimitIn(status), "max-watchers=1 of mesh");
  context.TryCancel();
  while (reader->Read(&event)) {
  }
}

// A server on a data directory, and then another that meshes differently.
class TwoVersions : public LiveDownloadTest {
 protected:
  TwoVersions()
      : directory_(::testing::TempDir() + "stellate-versions-" + std::to_string(getpid())) {
    std::filesystem::remove_all(directory_);
    Config config;
    config.data_dir = directory_;
    Start(config);
  }
  ~TwoVersions() override {
    server_.reset();
    std::filesystem::remove_all(directory_);
  }

  void StartTheOther() {
    server_.reset();
    Config config;
    config.data_dir = directory_;
    config.listen = "unix:" + directory_ + "/socket";
    auto other = Server::Start(config, [](core::Specification spec, core::Execution execution) {
      spec.random_seed += 1;
      return core::Mesher::Create(std::move(spec), execution);
    });
    ASSERT_TRUE(other) << other.error().message;
    server_ = std::move(*other);
    stub_ = NewStub();
  }

  const std::string directory_;
};

TEST_F(TwoVersions, AFinishedMeshOutlivesItsVersion) {
  const std::string name = CreateSphere();
  {
    RawWorker worker(stub_.get(), name);
    EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
  }
  const v1::Mesh mesh = Get(name);
  const auto content_of = [&] {
    grpc::ClientContext context;
    v1::DownloadMeshRequest request;
    request.set_name(name);
    const auto reader = stub_->DownloadMesh(&context, request);
    std::string content;
    v1::DownloadMeshResponse part;
    while (reader->Read(&part)) content += part.points().data() + part.cells().data();
    EXPECT_TRUE(reader->Finish().ok());
    return content;
  };
  const std::string content = content_of();
  StartTheOther();
  const v1::Mesh kept = Get(name);
  EXPECT_EQ(kept.state(), v1::MESH_STATE_SUCCEEDED) << "at once";
  EXPECT_EQ(kept.revision(), mesh.revision());
  EXPECT_EQ(kept.report().SerializeAsString(), mesh.report().SerializeAsString());
  EXPECT_TRUE(content_of() == content);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

// Its replay ends before the revision that a watcher has: it is told to forget that.
TEST_F(TwoVersions, AWatcherOfALostRevisionIsReset) {
  const std::string name = CreateSphere();
  std::uint64_t revision = 0;
  {
    // Leaves unanswered what is asked once there are three revisions, so that the mesh cannot end.
    v1::GetMeshRequest which;
    which.set_name(name);
    RawWorker worker(stub_.get(), name,
                     [&](const v1::QueryChunk& queries) -> std::optional<v1::ServeOracleRequest> {
                       grpc::ClientContext context;
                       v1::Mesh mesh;
                       const bool known = stub_->GetMesh(&context, which, &mesh).ok();
                       if (!known || mesh.revision() >= 3) return std::nullopt;
                       return RawWorker::Truly(queries);
                     });
    while (Get(name).revision() < 3) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    revision = Get(name).revision();
    server_.reset();
  }
  for (int restarts = 1; restarts <= 2; ++restarts) {
    StartTheOther();
    grpc::ClientContext context;
    v1::WatchMeshRequest request;
    request.set_name(name);
    request.set_from_revision(revision);
    const auto reader = stub_->WatchMesh(&context, request);
    v1::WatchMeshResponse event;
    int resets = 0;
    v1::Mesh final;
    while (reader->Read(&event)) {
      EXPECT_FALSE(event.has_delta() && resets == 0) << "of a mesh that it does not have";
      resets += event.has_reset_mesh() ? 1 : 0;
      if (event.has_final()) final = event.final();
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok()) << "restart " << restarts << ": " << status.error_message();
    EXPECT_EQ(resets, 1);
    EXPECT_EQ(final.state(), v1::MESH_STATE_FAILED);
    EXPECT_EQ(final.report().failure().reason(), "REPLAY_MISMATCH");
    EXPECT_LT(final.revision(), revision);
  }
}

}  // namespace
}  // namespace stellate::server::testing
