// Downloads that go into files part by part.

#include <grpcpp/server_builder.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "saved_files.h"
#include "scattered_download.h"
#include "stellate/mesh.h"

namespace stellate::testing {
namespace {

namespace fs = std::filesystem;

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
