// Meshes that are on a server, fetched by their name.
#include "stellate/download.h"

#include <grpcpp/create_channel.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "live.h"
#include "run/worker.h"
#include "saved_files.h"
#include "stellate/oracles/walls.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "support/spoiled_oracle.h"
#include "wire/convert.h"

namespace stellate::testing {
namespace {

namespace fs = std::filesystem;

class DownloadTest : public Live {
 protected:
  DownloadTest()
      : stub_(v1::Stellate::NewStub(
            grpc::CreateChannel(Server(), grpc::InsecureChannelCredentials()))),
        torus_(Make("torus:1:0.4")) {
    options_.connection.server = Server();
  }

  std::string Create(Oracle& oracle, double epsilon = 0.3) {
    grpc::ClientContext context;
    v1::CreateMeshRequest request;
    *request.mutable_spec() = client::ToSpec(oracle, At(epsilon)).value();
    v1::Mesh mesh;
    EXPECT_TRUE(stub_->CreateMesh(&context, request, &mesh).ok());
    return mesh.name();
  }

  void Serve(Oracle& oracle, const std::string& name) {
    client::Worker(*stub_, oracle, name, "test", {}).Run();
  }

  std::string Finished() {
    const std::string name = Create(*torus_);
    Serve(*torus_, name);
    return name;
  }

  // As MeshManifold collects it.
  Mesh Watched() { return MeshManifold(*torus_, At(0.3)).value(); }

  void Delete(const std::string& name) {
    grpc::ClientContext context;
    v1::DeleteMeshRequest request;
    request.set_name(name);
    google::protobuf::Empty empty;
    EXPECT_TRUE(stub_->DeleteMesh(&context, request, &empty).ok());
  }

  const std::unique_ptr<v1::Stellate::Stub> stub_;
  const std::unique_ptr<Manifold> torus_;
  DownloadOptions options_;
};

TEST_F(DownloadTest, AFinishedMeshComesWithItsReport) {
  const std::string name = Finished();
  std::pair<std::uint64_t, std::uint64_t> last;
  options_.unfinished = Unfinished::kWait;
  options_.on_part = [&last](auto received, auto all) { last = {received, all}; };
  const Expected<Mesh> mesh = DownloadMesh(name, options_);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(AreIdentical(*mesh, Watched()));
  EXPECT_TRUE(mesh->report.certified());
  EXPECT_EQ(last.first, mesh->report.counts.vertices + mesh->report.counts.simplices);
  EXPECT_EQ(last.first, last.second);
  Delete(name);
}

TEST_F(DownloadTest, AnEarlierRevisionComesWithoutAReport) {
  const std::string name = Finished();
  options_.revision = 2;
  const Expected<Mesh> mesh = DownloadMesh(name, options_);
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  const Mesh watched = Watched();
  EXPECT_GT(mesh->points.cols(), 0);
  EXPECT_LT(mesh->points.cols(), watched.points.cols());
  EXPECT_EQ(mesh->points, watched.points.leftCols(mesh->points.cols()));
  EXPECT_EQ(mesh->report.termination, Termination::kUnknown);
  options_.revision = 1'000'000;
  const Expected<Mesh> none = DownloadMesh(name, options_);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().reason, "REVISION_TOO_NEW");
  options_.revision = 0;
  const Expected<Mesh> zeroth = DownloadMesh(name, options_);
  ASSERT_FALSE(zeroth.has_value());
  EXPECT_TRUE(zeroth.error().message.starts_with("revision is 0;")) << zeroth.error().message;
  Delete(name);
}

TEST_F(DownloadTest, AMeshThatIsNotOverIsRefusedTakenOrWaitedFor) {
  const std::string name = Create(*torus_);
  const Expected<Mesh> refused = DownloadMesh(name, options_);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_NE(refused.error().message.find("not over: WAITING"), std::string::npos)
      << refused.error().message;

  options_.unfinished = Unfinished::kTake;
  const Expected<Mesh> taken = DownloadMesh(name, options_);
  ASSERT_TRUE(taken.has_value()) << taken.error().message;
  EXPECT_EQ(taken->points.cols(), 0);
  EXPECT_EQ(taken->ambient_dimension(), 3);
  EXPECT_EQ(taken->report.termination, Termination::kUnknown);

  options_.unfinished = Unfinished::kWait;
  std::thread worker([&] { Serve(*torus_, name); });
  const Expected<Mesh> mesh = DownloadMesh(name, options_);
  worker.join();
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  EXPECT_TRUE(AreIdentical(*mesh, Watched()));
  EXPECT_TRUE(mesh->report.certified());
  Delete(name);
}

TEST_F(DownloadTest, AMeshThatIsNotThereIsRefused) {
  const std::string name = Create(*torus_);
  Delete(name);
  for (const Unfinished unfinished : {Unfinished::kRefuse, Unfinished::kWait, Unfinished::kTake}) {
    options_.unfinished = unfinished;
    const Expected<Mesh> mesh = DownloadMesh(name, options_);
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().reason, "MESH_NOT_FOUND");
  }
  EXPECT_EQ(DownloadMesh("torus", options_).error().reason, "INVALID_ARGUMENT");
  options_.connection.server.clear();
  EXPECT_EQ(DownloadMesh(name, options_).error().code, ErrorCode::kRefused);
}

TEST_F(DownloadTest, AFailedMeshSaysWhyAndIsTakenWhenAskedFor) {
  SpoiledOracle spoiled(*torus_);
  spoiled.on_closest = [](const auto&, Answer& answer) { answer.points *= std::nan(""); };
  spoiled.on_flat = [](const auto&, const auto&, const auto&, Answer& answer) {
    answer.points *= std::nan("");
  };
  const std::string name = Create(spoiled);
  Serve(spoiled, name);
  options_.unfinished = Unfinished::kWait;
  const Expected<Mesh> failed = DownloadMesh(name, options_);
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().code, ErrorCode::kOracleFailed);
  EXPECT_EQ(failed.error().reason, "ORACLE_NOT_FINITE");
  options_.unfinished = Unfinished::kTake;
  const Expected<Mesh> taken = DownloadMesh(name, options_);
  ASSERT_TRUE(taken.has_value()) << taken.error().message;
  EXPECT_EQ(taken->report.failure_reason, "ORACLE_NOT_FINITE");
  Delete(name);
}

// All programs of a build lie in one directory.
int RunStellate(const std::string& arguments) {
  std::string command = fs::read_symlink("/proc/self/exe").parent_path() / "stellate";
  command.append(" ").append(arguments);
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(DownloadTest, TheCommandLineWritesTheSameFile) {
  const fs::path directory =
      fs::temp_directory_path() / ("stellate-fetch-" + std::to_string(getpid()));
  fs::create_directories(directory);
  const fs::path fetched = directory / "fetched.txt", watched = directory / "watched.txt";
  const std::string on_server = " --server '" + Server() + "' -o " + fetched.string();
  ASSERT_TRUE(Watched().Save(watched).has_value());

  const std::string name = Finished();
  EXPECT_EQ(RunStellate("download --wait -q " + name + on_server), 0);
  EXPECT_EQ(ReadFile(fetched), ReadFile(watched));
  const std::string unserved = Create(*torus_);
  EXPECT_EQ(RunStellate("download -q " + unserved + on_server), 2) << "it is not over";
  EXPECT_EQ(RunStellate("download --unfinished -q " + unserved + on_server), 1);
  EXPECT_EQ(ReadFile(fetched), "2 3 0 0\n");
  Delete(name);
  Delete(unserved);
  fs::remove_all(directory);
}

// Walls group the files, whose bytes are those of the mesh that is held whole.
TEST_F(DownloadTest, MeshesWithWallsGoIntoFilesAsTheyCome) {
  const fs::path directory =
      fs::temp_directory_path() / ("stellate-walls-" + std::to_string(getpid()));
  fs::create_directories(directory);
  for (const auto& [shape, epsilon] : {std::pair{"half-torus", 0.3}, std::pair{"cylinder", 0.4}}) {
    const auto domain = oracles::MakeDomain(shape).value();
    const std::string name = Create(*domain, epsilon);
    Serve(*domain, name);
    const Expected<Mesh> whole = DownloadMesh(name, options_);
    ASSERT_TRUE(whole.has_value()) << whole.error().message;
    EXPECT_FALSE(whole->boundary().empty());
    std::vector<std::string> paths;
    for (const std::string ending : {"vtu", "msh", "obj", "txt"})
      paths.push_back(directory / ("parts." + ending));
    const Expected<SavedMesh> saved = DownloadMeshTo(name, paths, options_);
    ASSERT_TRUE(saved.has_value()) << saved.error().message;
    EXPECT_EQ(saved->simplices, static_cast<std::uint64_t>(whole->simplices.cols()));
    for (const std::string& path : paths)
      EXPECT_EQ(ReadFile(path),
                SavedAs(directory / ("w" + fs::path(path).filename().string()), *whole))
          << path;
    EXPECT_EQ(std::distance(fs::directory_iterator(directory), {}), 8) << "and no other file";
    Delete(name);
  }
  fs::remove_all(directory);
}

}  // namespace
}  // namespace stellate::testing
