// Meshes that are on a server, fetched by their name.
#include "stellate/download.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/server_builder.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "live.h"
#include "run/worker.h"
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

std::string ReadFile(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
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

std::string SavedAs(const std::string& path, const Mesh& mesh) {
  EXPECT_TRUE(mesh.Save(path).has_value()) << path;
  return ReadFile(path);
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

TEST_F(BrokenDownload, GoesOnWhereItWas) {
  fake_.breaks = {4, 0, 5};
  const Expected<Mesh> mesh = Fetch();
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  using Asked = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(fake_.asked, (Asked{{0, 0}, {7, 4}, {7, 4}, {7, 9}}));
  EXPECT_EQ(outages_, 2);  // gRPC itself repeats the call that brought nothing
  ASSERT_EQ(mesh->points.cols(), 6);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(mesh->points.col(i), Eigen::Vector2d(i, 0.5));
  SimplexMatrix cells(2, 6);
  cells << 0, 0, 1, 2, 3, 4,  //
      1, 5, 2, 3, 4, 5;
  EXPECT_EQ(mesh->simplices, cells);
  EXPECT_EQ(mesh->report.termination, Termination::kConverged);
}

TEST_F(BrokenDownload, IsNotResumedWhereThatIsOfNoUse) {
  options_.connection.reconnect = Seconds(0);
  fake_.breaks = {4};
  Expected<Mesh> mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
  EXPECT_NE(mesh.error().message.find("broken by the test"), std::string::npos);
  options_.connection.reconnect = Seconds(60);
  fake_.breaks = {4};
  fake_.with = {grpc::StatusCode::RESOURCE_EXHAUSTED, "too many"};
  mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kRefused);
  EXPECT_EQ(fake_.asked.size(), 2u);
}

TEST_F(BrokenDownload, EndsWhenItIsStopped) {
  std::stop_source source;
  options_.stop = source.get_token();
  options_.on_part = [&source](auto, auto) { source.request_stop(); };
  fake_.breaks = {4};
  const Expected<Mesh> mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kStopped);
}

TEST_F(BrokenDownload, PartsThatDoNotFitAreTheServersFault) {
  const std::vector<std::function<void(v1::DownloadMeshResponse*)>> faults = {
      [](auto* part) { part->set_first_vertex(part->first_vertex() + 1); },
      [](auto* part) { part->set_simplices(8); }, [](auto* part) { part->set_complete(false); },
      [](auto* part) { part->mutable_points()->set_data("short"); },
      [](auto* part) {
        const std::uint32_t cell[] = {0, 9};
        if (part->complete()) part->mutable_cells()->set_data(cell, sizeof cell);
      }};
  for (const auto& fault : faults) {
    fake_.spoil = fault;
    const Expected<Mesh> mesh = Fetch();
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed) << mesh.error().message;
  }
}

class FilesOfADownload : public BrokenDownload {
 protected:
  FilesOfADownload()
      : directory_(fs::temp_directory_path() / ("stellate-parts-" + std::to_string(getpid()))) {
    fs::create_directories(directory_);
    fake_.in_order = true;
  }
  ~FilesOfADownload() override { fs::remove_all(directory_); }

  std::string Path(const std::string& name) const { return (directory_ / name).string(); }
  Expected<SavedMesh> FetchTo(const std::vector<std::string>& names) {
    std::vector<std::string> paths;
    for (const std::string& name : names) paths.push_back(Path(name));
    return DownloadMeshTo("meshes/x", paths, options_);
  }
  std::vector<std::string> Left() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(directory_))
      names.push_back(entry.path().filename());
    std::sort(names.begin(), names.end());
    return names;
  }

  const fs::path directory_;
};

TEST_F(FilesOfADownload, AreThoseOfTheWholeMesh) {
  const std::vector<std::string> endings = {"txt", "off", "obj", "ply", "msh", "vtu"};
  std::vector<std::string> names;
  for (const std::string& ending : endings) names.push_back("parts." + ending);
  fake_.breaks = {4, 0, 5};
  const Expected<SavedMesh> saved = FetchTo(names);
  ASSERT_TRUE(saved.has_value()) << saved.error().message;
  EXPECT_TRUE(saved->failures.empty());
  EXPECT_EQ(saved->vertices, 6u);
  EXPECT_EQ(saved->simplices, 6u);
  EXPECT_EQ(saved->report.termination, Termination::kConverged);
  using Asked = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(fake_.asked, (Asked{{0, 0}, {7, 4}, {7, 4}, {7, 9}})) << "in one go, resumed";
  fake_.breaks.clear();
  const Mesh whole = Fetch().value();
  for (const std::string& ending : endings) {
    ASSERT_TRUE(whole.Save(Path("whole." + ending)).has_value());
    const std::string bytes = ReadFile(Path("parts." + ending));
    EXPECT_GT(bytes.size(), 40u);
    EXPECT_EQ(bytes, ReadFile(Path("whole." + ending))) << ending;
  }
  EXPECT_NE(ReadFile(Path("parts.off")).find("\n2 5 0\n"), std::string::npos) << "turned";
}

TEST_F(FilesOfADownload, OfAMeshThatIsNotInOrderAreThoseOfTheWholeMesh) {
  fake_.in_order = false;
  ASSERT_TRUE(FetchTo({"a.txt", "a.vtu"}).has_value());
  EXPECT_EQ(fake_.asked.size(), 2u) << "once more, from the start";
  EXPECT_EQ(fake_.asked.back().second, 0u);
  ASSERT_TRUE(Fetch().value().Save(Path("b.vtu")).has_value());
  EXPECT_EQ(ReadFile(Path("a.vtu")), ReadFile(Path("b.vtu")));
  EXPECT_EQ(Left(), (std::vector<std::string>{"a.txt", "a.vtu", "b.vtu"}));
}

// The old file stays, and nothing beside it.
TEST_F(FilesOfADownload, AreNotThereByHalves) {
  std::ofstream(Path("a.vtu")) << "old";
  const auto expect_old = [this](ErrorCode code) {
    const Expected<SavedMesh> saved = FetchTo({"a.vtu", "b.txt"});
    ASSERT_FALSE(saved.has_value());
    EXPECT_EQ(saved.error().code, code) << saved.error().message;
    EXPECT_EQ(ReadFile(Path("a.vtu")), "old");
    EXPECT_EQ(Left(), std::vector<std::string>{"a.vtu"});
  };
  options_.connection.reconnect = Seconds(0);
  fake_.breaks = {8};
  expect_old(ErrorCode::kServerFailed);
  const std::vector<std::function<void(v1::DownloadMeshResponse*)>> faults = {
      [](auto* part) { part->set_first_vertex(part->first_vertex() + 1); },
      [](auto* part) { part->set_simplices(8); },
      [](auto* part) { part->set_simplices(part->complete() ? 7 : 6); },
      [](auto* part) { part->set_complete(false); },
      [](auto* part) { part->mutable_points()->set_data("short"); },
      [](auto* part) { part->mutable_orientation()->set_turned("more"); },
      [](auto* part) {
        const std::uint32_t cell[] = {5, 4};
        if (part->complete()) part->mutable_cells()->set_data(cell, sizeof cell);
      },
      [](auto* part) {
        const std::uint32_t cell[] = {4, 9};
        if (part->complete()) part->mutable_cells()->set_data(cell, sizeof cell);
      }};
  for (const auto& fault : faults) {
    fake_.spoil = fault;
    expect_old(ErrorCode::kServerFailed);
  }
  fake_.spoil = {};
  std::stop_source source;
  options_.connection.reconnect = Seconds(60);
  options_.stop = source.get_token();
  options_.on_part = [&source](auto received, auto) {
    if (received == 8) source.request_stop();
  };
  fake_.breaks = {8};
  expect_old(ErrorCode::kStopped);
}

TEST_F(FilesOfADownload, WithoutRoomForTheirGroupsLeaveTheOthers) {
  fake_.has_wall = true;
  const auto whole = [this] { return FetchTo({"a.vtu", "b.txt"}); };
  EXPECT_TRUE(whole().value().failures.empty());
  EXPECT_NE(ReadFile(Path("a.vtu")).find("wall"), std::string::npos);
  fs::remove(Path("a.vtu"));
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit limit = before;
  limit.rlim_cur = 90;  // bytes that a file may grow to; the points have 96
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &limit);
  const Expected<SavedMesh> saved = whole(), none = FetchTo({"c.vtu"});
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  ASSERT_TRUE(saved.has_value()) << saved.error().message;
  ASSERT_EQ(saved->failures.size(), 1u);
  EXPECT_NE(saved->failures[0].message.find("a.vtu: "), std::string::npos);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, ErrorCode::kFileFailed);
  EXPECT_EQ(Left(), std::vector<std::string>{"b.txt"});
}

TEST_F(FilesOfADownload, OfWallsThatAreNotBesideTheirVerticesAreTheServersFault) {
  fake_.has_wall = true;
  const std::vector<std::function<void(v1::DownloadMeshResponse*)>> faults = {
      [](auto* part) { part->add_boundary_vertices(0); },
      [](auto* part) {
        part->add_boundary_vertices(part->first_vertex() == 0 ? 3 : 0);
        part->add_boundary_walls(1);
      },
      [](auto* part) {
        if (part->complete()) part->set_cell_labels("\1");
      }};
  for (const auto& fault : faults) {
    fake_.spoil = fault;
    const Expected<SavedMesh> saved = FetchTo({"a.vtu"});
    ASSERT_FALSE(saved.has_value());
    EXPECT_EQ(saved.error().code, ErrorCode::kServerFailed) << saved.error().message;
  }
  EXPECT_TRUE(Left().empty());
}

TEST_F(FilesOfADownload, ThatCannotBeWrittenLeaveTheOthers) {
  EXPECT_EQ(FetchTo({"missing/a.txt", "b.txt"}).error().code, ErrorCode::kFileFailed);
  EXPECT_TRUE(fake_.asked.empty()) << "before anything is fetched";
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit limit = before;
  limit.rlim_cur = 400;  // bytes that a file may grow to
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &limit);
  const Expected<SavedMesh> saved = FetchTo({"a.vtu", "b.txt"}), none = FetchTo({"c.vtu"});
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  ASSERT_TRUE(saved.has_value()) << saved.error().message;
  ASSERT_EQ(saved->failures.size(), 1u);
  EXPECT_NE(saved->failures[0].message.find("a.vtu: File too large"), std::string::npos);
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, ErrorCode::kFileFailed);
  EXPECT_EQ(Left(), std::vector<std::string>{"b.txt"});
}

// Two triangles for each vertex but the last ones; the first thousand vertices are on a wall.
class Large final : public v1::Stellate::Service {
 public:
  bool has_wall = false;
  static constexpr std::uint64_t kRows = 4000;  // in a part
  static constexpr std::uint64_t kVertices = 150 * kRows, kSimplices = 2 * (kVertices - kRows);

  grpc::Status GetMesh(grpc::ServerContext*, const v1::GetMeshRequest* request,
                       v1::Mesh* mesh) override {
    mesh->set_name(request->name());
    mesh->set_state(v1::MESH_STATE_SUCCEEDED);
    mesh->set_revision(1);
    mesh->mutable_spec()->set_dimension(2);
    mesh->mutable_spec()->set_ambient_dimension(3);
    mesh->mutable_spec()->set_walls(has_wall ? 1 : 0);
    mesh->mutable_end_time()->set_seconds(1);
    return grpc::Status::OK;
  }

  grpc::Status DownloadMesh(grpc::ServerContext*, const v1::DownloadMeshRequest*,
                            grpc::ServerWriter<v1::DownloadMeshResponse>* writer) override {
    for (std::uint64_t first = 0; first < kVertices + kSimplices; first += kRows) {
      v1::DownloadMeshResponse part;
      part.set_revision(1);
      part.set_vertices(kVertices);
      part.set_simplices(kSimplices);
      part.set_first_vertex(std::min(first, kVertices));
      if (first < kVertices) {
        std::vector<double> points(3 * kRows, static_cast<double>(first));
        part.mutable_points()->add_shape(kRows);
        part.mutable_points()->add_shape(3);
        part.mutable_points()->set_data(points.data(), points.size() * sizeof(double));
        for (std::uint32_t i = 0; first == 0 && has_wall && i < 1000; ++i) {
          part.add_boundary_vertices(i);
          part.add_boundary_walls(1);
        }
      } else {
        std::vector<std::uint32_t> cells;
        for (std::uint64_t s = first - kVertices; s < first - kVertices + kRows; ++s) {
          const auto a = static_cast<std::uint32_t>(s / 2);
          cells.insert(cells.end(), {a, a + 1, a + 2 + static_cast<std::uint32_t>(s % 2)});
        }
        part.mutable_cells()->add_shape(kRows);
        part.mutable_cells()->add_shape(3);
        part.mutable_cells()->set_data(cells.data(), cells.size() * sizeof(std::uint32_t));
        part.mutable_orientation()->set_orientable(true);
        part.mutable_orientation()->set_turned(std::string(kRows / 8, '\x55'));
      }
      part.set_next_position(first + kRows);
      part.set_complete(first + kRows >= kVertices + kSimplices);
      if (!writer->Write(part)) return grpc::Status::CANCELLED;
    }
    return grpc::Status::OK;
  }
};

// The most memory that the command had, in bytes.
std::size_t PeakOf(const std::string& mesh, const std::string& server, const std::string& path) {
  const std::string program = fs::read_symlink("/proc/self/exe").parent_path() / "stellate";
  const pid_t child = fork();
  if (child == 0) {
    execl(program.c_str(), "stellate", "download", mesh.c_str(), "-q", "-o", path.c_str(),
          "--server", server.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage usage{};
  EXPECT_EQ(wait4(child, &status, 0, &usage), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << "not certified: " << status;
  return static_cast<std::size_t>(usage.ru_maxrss) << 10;
}

// The mesh itself takes 29 MB, and took some 465 B a vertex on its way into the file: 280 MB.
TEST(LargeDownload, TakesLittleMemory) {
  Large large;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&large);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  const fs::path path =
      fs::temp_directory_path() / ("stellate-large-" + std::to_string(getpid()) + ".vtu");
  for (const bool has_wall : {false, true}) {
    large.has_wall = has_wall;
    EXPECT_LT(PeakOf("meshes/x", "127.0.0.1:" + std::to_string(port), path), 100u << 20);
    EXPECT_GT(fs::file_size(path), 48 * Large::kVertices);
    fs::remove(path);
  }
}

}  // namespace
}  // namespace stellate::testing
