// What Prometheus reads from a live server.

#include "server/metrics/metrics.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "server/base/version.h"
#include "tests/server/support/certificates.h"
#include "tests/server/support/live_server.h"
#include "tests/server/support/loopback.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;

class MetricsTest : public LiveServer {
 protected:
  void StartWithMetrics(Config config = {}) {
    config.metrics_listen = "127.0.0.1:0";
    Start(config);
    ASSERT_GT(server_->metrics_port(), 0);
  }

  // Series and their values; checks that every line is what the text format allows.
  std::map<std::string, double> Scrape() {
    const std::string reply = GetMetrics(server_->metrics_port());
    EXPECT_EQ(reply.find("HTTP/1.1 200"), 0u) << reply;
    std::istringstream lines(reply.substr(std::min(reply.find("\r\n\r\n"), reply.size() - 4) + 4));
    static const std::regex kSample(
        R"((\w+(?:\{\w+="[^"]*"(?:,\w+="[^"]*")*\})?) ([-+0-9.eE]+|\+Inf|[Nn]a[Nn]))");
    std::map<std::string, double> series;
    for (std::string line; std::getline(lines, line);) {
      if (line.empty() || line.starts_with("# HELP ") || line.starts_with("# TYPE ")) continue;
      std::smatch match;
      EXPECT_TRUE(std::regex_match(line, match, kSample)) << line;
      if (!match.empty()) series[match[1]] = std::stod(match[2]);
    }
    return series;
  }
};

TEST_F(MetricsTest, NobodyListensUnlessAsked) {
  Start();
  EXPECT_EQ(server_->metrics_port(), 0);
}

TEST_F(MetricsTest, CountsAMeshFromItsStartToItsEnd) {
  StartWithMetrics();
  EXPECT_EQ(Scrape().at("stellate_meshes{state=\"WAITING\"}"), 0);
  const std::string name = CreateSphere();
  EXPECT_EQ(Scrape().at("stellate_meshes{state=\"WAITING\"}"), 1);
  while (Scrape().at("stellate_queries_waiting") == 0) std::this_thread::yield();
  EXPECT_EQ(Scrape().at("stellate_meshes_idle"), 1);

  std::atomic<bool> open{false};
  RawWorker worker(stub_.get(), name, [&open](const v1::QueryChunk& queries) {
    while (!open) std::this_thread::yield();
    return RawWorker::Truly(queries);
  });
  std::thread watching([&] { WatchToEnd(name); });
  while (worker.chunks() == 0 || Get(name).watchers() == 0) std::this_thread::yield();
  auto series = Scrape();
  EXPECT_EQ(series.at("stellate_meshes{state=\"RUNNING\"}"), 1);
  EXPECT_EQ(series.at("stellate_meshes{state=\"WAITING\"}"), 0);
  EXPECT_EQ(series.at("stellate_meshes_idle"), 0);
  EXPECT_EQ(series.at("stellate_workers"), 1);
  EXPECT_EQ(series.at("stellate_watchers"), 1);
  EXPECT_EQ(series.at("stellate_rounds_total"), 0);
  EXPECT_EQ(series.at("stellate_answer_seconds_count"), 0);
  EXPECT_GT(series.at("stellate_queries_waiting"), 0);
  EXPECT_GT(series.at("stellate_mesh_bytes"), 0);
  EXPECT_GT(series.at("process_resident_memory_bytes"), series.at("stellate_mesh_bytes"));
  EXPECT_EQ(series.at("stellate_hedged_chunks_total"), 0) << "nobody is idle";

  open = true;
  watching.join();
  EXPECT_TRUE(worker.Wait().ok());
  const v1::Mesh mesh = Get(name);
  series = Scrape();
  EXPECT_EQ(series.at("stellate_meshes{state=\"SUCCEEDED\"}"), 1);
  EXPECT_EQ(series.at("stellate_meshes_ended_total{state=\"SUCCEEDED\"}"), 1);
  EXPECT_EQ(series.at("stellate_meshes_ended_total{state=\"FAILED\"}"), 0);
  EXPECT_EQ(series.at("stellate_certificates_total{certified=\"true\"}"), 1);
  EXPECT_EQ(series.at("stellate_certificates_total{certified=\"false\"}"), 0);
  EXPECT_EQ(series.at("stellate_vertices"), mesh.progress().vertices());
  EXPECT_GT(series.at("stellate_rounds_total"), 0);
  EXPECT_EQ(series.at("stellate_queries_waiting"), 0);
  EXPECT_EQ(series.at("stellate_compared_queries_total"), 0) << "one worker alone";
  EXPECT_EQ(series.at("stellate_disagreements_total"), 0);
  EXPECT_GE(series.at("stellate_queries_total"), series.at("stellate_vertices"));
  EXPECT_EQ(series.at("stellate_answer_seconds_count"), worker.chunks());
  EXPECT_EQ(series.at("stellate_answer_seconds_bucket{le=\"+Inf\"}"), worker.chunks());
  // A query is three numbers, and so is an answer.
  const double least = 24 * series.at("stellate_queries_total");
  EXPECT_GE(series.at("stellate_sent_bytes_total"), least);
  EXPECT_GE(series.at("stellate_received_bytes_total"), least);

  // What was counted stays counted when the mesh is gone.
  v1::DeleteMeshRequest request;
  request.set_name(name);
  google::protobuf::Empty empty;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->DeleteMesh(&context, request, &empty).ok());
  const auto after = Scrape();
  EXPECT_EQ(after.at("stellate_meshes{state=\"SUCCEEDED\"}"), 0);
  EXPECT_EQ(after.at("stellate_vertices"), 0);
  EXPECT_EQ(after.at("stellate_mesh_bytes"), 0);
  EXPECT_EQ(after.at("stellate_rounds_total"), series.at("stellate_rounds_total"));
}

TEST_F(MetricsTest, AMeshThatEndsBadlyCountsAsNotCertified) {
  StartWithMetrics();
  const std::string name = CreateSphere();
  RawWorker liar(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    *request.mutable_answers() = TrueAnswer(queries);
    Poke(request.mutable_answers()->mutable_points(), 0, std::nan(""));
    return std::optional(request);
  });
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_FAILED);
  const auto series = Scrape();
  EXPECT_EQ(series.at("stellate_meshes_ended_total{state=\"FAILED\"}"), 1);
  EXPECT_EQ(series.at("stellate_certificates_total{certified=\"false\"}"), 1);
}

TEST_F(MetricsTest, SaysWhatTheProcessIsAndUses) {
  const auto before = std::chrono::system_clock::now().time_since_epoch();
  StartWithMetrics();
  auto series = Scrape();
  const auto info = std::find_if(series.begin(), series.end(), [](const auto& one) {
    return one.first.starts_with("stellate_build_info{");
  });
  ASSERT_NE(info, series.end());
  EXPECT_EQ(info->second, 1);
  EXPECT_NE(info->first.find(core::Message("version=\"", Version(), "\"")), std::string::npos);
  EXPECT_NE(info->first.find("grpc=\"1."), std::string::npos);

  // This process began before it asked, and not before the machine did.
  const double now = std::chrono::duration<double>(before).count();
  EXPECT_LE(series.at("process_start_time_seconds"), now + 1);
  EXPECT_GT(series.at("process_start_time_seconds"), now - 3600);
  EXPECT_GT(series.at("process_virtual_memory_bytes"), series.at("process_resident_memory_bytes"));
  EXPECT_GE(series.at("process_threads"), 2);
  EXPECT_GT(series.at("process_max_fds"), series.at("process_open_fds"));
  const ScratchDirectory directory;
  std::vector<std::ofstream> files(20);
  for (std::size_t i = 0; i < files.size(); ++i) files[i].open(directory / std::to_string(i));
  const double open = series.at("process_open_fds");
  const double used = series.at("process_cpu_seconds_total");
  EXPECT_GT(used, 0);
  series = Scrape();
  EXPECT_GE(series.at("process_open_fds"), open + 15);  // some connection may have closed
  EXPECT_GT(series.at("process_cpu_seconds_total"), used);
}

TEST_F(MetricsTest, CountsWhatLimitsRefuse) {
  Config config;
  config.max_meshes = 1;
  config.max_rounds = 10;
  StartWithMetrics(config);
  CreateSphere();
  v1::Mesh mesh;
  EXPECT_FALSE(Create(SpecOfSphere(), &mesh).ok());
  EXPECT_FALSE(Create(SpecOfSphere(), &mesh).ok());
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_max_rounds(11);
  EXPECT_FALSE(Create(spec, &mesh).ok());
  const auto series = Scrape();
  EXPECT_EQ(series.at("stellate_limit_refusals_total{limit=\"max-meshes\"}"), 2);
  EXPECT_EQ(series.at("stellate_limit_refusals_total{limit=\"max-rounds\"}"), 1);
}

TEST_F(MetricsTest, NamesNoMeshNoOwnerAndNoToken) {
  const ScratchDirectory directory;
  WriteFile(directory / "tokens", "alice alice-0123456789abcdef\n");
  Config config;
  config.token_file = directory / "tokens";
  config.owner_meshes = 1;
  StartWithMetrics(config);
  v1::CreateMeshRequest request;
  *request.mutable_spec() = SpecOfSphere();
  request.mutable_spec()->set_label("a-label");
  v1::Mesh mesh;
  for (const char* token : {"alice-0123456789abcdef", "alice-0123456789abcdef", "nobody"}) {
    grpc::ClientContext context;  // the second is one too many, the third unknown
    context.AddMetadata("authorization", std::string("Bearer ") + token);
    stub_->CreateMesh(&context, request, &mesh);
  }
  const std::string reply = GetMetrics(server_->metrics_port());
  EXPECT_NE(reply.find("stellate_meshes{state=\"WAITING\"} 1"), std::string::npos) << reply;
  EXPECT_NE(reply.find("stellate_limit_refusals_total{limit=\"owner-meshes\"} 1"),
            std::string::npos)
      << reply;
  for (const std::string& word : {mesh.name().substr(mesh.name().find('/') + 1),
                                  std::string("alice"), std::string("a-label")}) {
    EXPECT_EQ(reply.find(word), std::string::npos) << reply;
  }
}

// However many there are, and however long they say nothing or do not come to an end.
TEST_F(MetricsTest, SilentConnectionsKeepNobodyFromBeingAnswered) {
  StartWithMetrics();
  std::vector<int> silent;
  for (int i = 0; i < 200; ++i) {
    silent.push_back(ConnectTo(server_->metrics_port()));
    const std::string half = "GET /metrics HTTP/1.1\r\nHost: ";
    if (i % 2 == 1) send(silent.back(), half.data(), half.size(), MSG_NOSIGNAL);
  }
  EXPECT_EQ(Scrape().at("stellate_meshes{state=\"WAITING\"}"), 0);
  for (const int fd : silent) close(fd);
}

TEST_F(MetricsTest, ProbesAndPeopleAreAnsweredToo) {
  StartWithMetrics();
  CreateSphere();
  const int port = server_->metrics_port();
  EXPECT_EQ(GetPage(port, "/healthz").find("HTTP/1.1 200"), 0u);
  EXPECT_EQ(GetPage(port, "/nothing").find("HTTP/1.1 404"), 0u);
  const std::string page = GetPage(port, "/?from=a+bookmark");
  EXPECT_EQ(page.find("HTTP/1.1 200"), 0u) << page;
  EXPECT_NE(page.find("Content-Type: text/html"), std::string::npos) << page;
  EXPECT_NE(page.find(Version()), std::string::npos) << page;
  EXPECT_NE(page.find("<tr><td>WAITING<td>1"), std::string::npos) << page;

  // While it drains a worker's mesh it still answers, and probes are told.
  std::atomic<bool> open{false};
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name, [&open](const v1::QueryChunk& queries) {
    while (!open) std::this_thread::yield();
    return RawWorker::Truly(queries);
  });
  while (worker.chunks() == 0) std::this_thread::yield();
  std::thread stopping([this] { server_->Stop(60s); });
  std::string health;
  do health = GetPage(port, "/healthz");
  while (health.find("HTTP/1.1 200") == 0);
  EXPECT_EQ(health.find("HTTP/1.1 503"), 0u) << health;
  EXPECT_NE(GetPage(port, "/").find("draining"), std::string::npos);
  EXPECT_NE(health.find("draining"), std::string::npos) << health;
  open = true;
  stopping.join();
}

TEST_F(MetricsTest, ProbesAreToldThatNoMeshCanBeRecorded) {
  const ScratchDirectory directory;
  Config config;
  config.data_dir = directory / "data";
  StartWithMetrics(config);
  const int port = server_->metrics_port();
  EXPECT_EQ(GetPage(port, "/healthz").find("HTTP/1.1 200"), 0u);
  // As where a volume has gone, or has become read-only.
  std::filesystem::rename(directory / "data", directory / "elsewhere");
  const std::string health = GetPage(port, "/healthz");
  EXPECT_EQ(health.find("HTTP/1.1 503"), 0u) << health;
  EXPECT_NE(health.find("cannot be written to: No such file"), std::string::npos) << health;
  std::filesystem::rename(directory / "elsewhere", directory / "data");
  EXPECT_EQ(GetPage(port, "/healthz").find("HTTP/1.1 200"), 0u) << "it is back";
  server_.reset();

  config.max_journal_bytes = 100'000;  // no mesh begins with so little
  StartWithMetrics(config);
  const std::string full = GetPage(server_->metrics_port(), "/healthz");
  EXPECT_EQ(full.find("HTTP/1.1 503"), 0u) << full;
  EXPECT_NE(full.find("raise --max-journal-bytes"), std::string::npos) << full;
  v1::Mesh mesh;
  EXPECT_EQ(Create(SpecOfSphere(), &mesh).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  server_.reset();  // before its directory goes
}

TEST_F(MetricsTest, ATakenPortIsRefusedAndAStoppedServerAnswersNoMore) {
  StartWithMetrics();
  const int port = server_->metrics_port();
  Config config;
  config.listen = "127.0.0.1:0";
  config.metrics_listen = "127.0.0.1:" + std::to_string(port);
  const auto second = Server::Start(config);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("--metrics-listen"), std::string::npos);
  EXPECT_TRUE(server_->Stop(0s));
  EXPECT_EQ(GetMetrics(port), "");
}

}  // namespace
}  // namespace stellate::server::testing
