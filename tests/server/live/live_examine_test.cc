// Examine against a live server: what it finds, and what it does when oracles and clients
// misbehave.

#include <filesystem>
#include <limits>
#include <mutex>
#include <set>
#include <vector>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;

// One call, read to its end on the thread that waits.
class Examination {
 public:
  Examination(v1::Stellate::Stub* stub, const v1::MeshSpec& spec) {
    v1::ExamineRequest request;
    *request.mutable_spec() = spec;
    reader_ = stub->Examine(&context_, request);
  }

  // The mesh to serve; empty: none came.
  std::string Name() {
    v1::ExamineResponse response;
    if (!reader_->Read(&response)) return "";
    if (!response.has_mesh()) {
      Keep(response);
      return "";
    }
    EXPECT_EQ(response.mesh().state(), v1::MESH_STATE_WAITING);
    worker_wait = response.mesh().spec().limits().worker_wait_seconds();
    return response.mesh().name();
  }

  grpc::Status Finish() {
    v1::ExamineResponse response;
    while (reader_->Read(&response)) Keep(response);
    return reader_->Finish();
  }

  void Cancel() { context_.TryCancel(); }

  // Null: it was not found.
  const v1::Finding* Find(const std::string& code) const {
    for (const v1::Finding& finding : report.findings())
      if (finding.code() == code) return &finding;
    return nullptr;
  }

  std::vector<std::string> codes;  // of the findings, as they came
  v1::CheckReport report;
  bool is_reported = false;
  double worker_wait = 0;  // seconds

 private:
  void Keep(const v1::ExamineResponse& response) {
    EXPECT_FALSE(is_reported);
    if (response.has_finding()) codes.push_back(response.finding().code());
    if (!response.has_report()) return;
    report = response.report();
    is_reported = true;
  }

  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::ExamineResponse>> reader_;
};

class LiveExamineTest : public LiveServer {
 protected:
  bool Exists(const std::string& name) {
    grpc::ClientContext context;
    v1::GetMeshRequest request;
    request.set_name(name);
    v1::Mesh mesh;
    return stub_->GetMesh(&context, request, &mesh).ok();
  }

  // Whether the mesh is gone, or goes within a few seconds.
  bool Goes(const std::string& name) {
    for (int look = 0; look < 500 && Exists(name); ++look)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return !Exists(name);
  }
};

TEST_F(LiveExamineTest, SaysWhatItFindsAndLeavesNothing) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.clear_epsilon();
  Examination examination(stub_.get(), spec);
  const std::string name = examination.Name();
  std::mutex mutex;
  std::vector<std::uint32_t> sizes;
  RawWorker worker(stub_.get(), name, [&](const v1::QueryChunk& queries) {
    const std::lock_guard lock(mutex);
    sizes.push_back(queries.points().shape(0));
    return RawWorker::Truly(queries);
  });
  const grpc::Status status = examination.Finish();
  ASSERT_TRUE(status.ok()) << status.error_message();
  const v1::CheckReport& report = examination.report;
  EXPECT_TRUE(report.ok()) << report.text();
  EXPECT_NEAR(report.reach(), 1, 1e-6);
  EXPECT_EQ(report.epsilon(), 0.25);
  EXPECT_TRUE(report.epsilon_reason().starts_with("a quarter of the reach, about 1 by "));
  EXPECT_EQ(report.pieces(), 1u);
  EXPECT_FALSE(report.rates().empty());
  EXPECT_NE(report.text().find("\nThe oracle keeps its contract: 0 errors"), std::string::npos);
  std::set<std::string> streamed(examination.codes.begin(), examination.codes.end()), reported;
  for (const v1::Finding& finding : report.findings()) reported.insert(finding.code());
  EXPECT_EQ(streamed, reported);
  EXPECT_EQ(streamed.size(), examination.codes.size());
  EXPECT_TRUE(worker.Wait().ok());
  EXPECT_EQ(worker.over(), "MESH_STATE_SUCCEEDED");
  // A law's batch came whole: its answers are compared with those in other batches.
  ASSERT_GT(sizes.size(), 4u);
  EXPECT_GE(sizes[0], 100u);
  EXPECT_EQ(sizes[0], sizes[1]);
  EXPECT_EQ(sizes[3], 1u);
  EXPECT_TRUE(Goes(name));
}

TEST_F(LiveExamineTest, ComparesThePlannedEpsilonWithTheReach) {
  Start();
  Examination examination(stub_.get(), SpecOfSphere(0.9));
  RawWorker worker(stub_.get(), examination.Name());
  ASSERT_TRUE(examination.Finish().ok());
  const v1::Finding* const coarse = examination.Find("COARSE_EPSILON");
  ASSERT_NE(coarse, nullptr) << examination.report.text();
  EXPECT_EQ(coarse->severity(), v1::SEVERITY_WARNING);
  EXPECT_EQ(coarse->numbers().at("epsilon"), 0.9);
}

struct Fault {
  const char* finding;
  void (*tell)(const v1::QueryChunk& queries, v1::ServeOracleRequest* request);
};

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void SayItFailed(const v1::QueryChunk& queries, const char* reason,
                 v1::ServeOracleRequest* request) {
  v1::OracleFailure failure;
  failure.set_lease(queries.lease());
  failure.set_message("it fell\x1b over");
  failure.set_reason(reason);
  *request->mutable_failure() = failure;
}

const Fault kFaults[] = {
    {"WRONG_SHAPE",
     [](const v1::QueryChunk&, v1::ServeOracleRequest* r) {
       r->mutable_answers()->mutable_points()->mutable_data()->pop_back();
     }},
    {"NOT_FINITE",
     [](const v1::QueryChunk&, v1::ServeOracleRequest* r) {
       Poke(r->mutable_answers()->mutable_points(), 1, kNaN);
     }},
    {"TANGENT_NOT_ORTHONORMAL",
     [](const v1::QueryChunk& q, v1::ServeOracleRequest* r) {
       if (q.want_tangents()) Poke(r->mutable_answers()->mutable_tangents(), 0, 2.0);
     }},
    {"FLAT_OFF",
     [](const v1::QueryChunk& q, v1::ServeOracleRequest* r) {
       if (q.kind() == v1::QUERY_KIND_INTERSECT_FLAT)
         for (std::size_t i = 0; i < 3; ++i) Poke(r->mutable_answers()->mutable_points(), i, 0.7);
     }},
    {"BATCH_DEPENDENT",
     [](const v1::QueryChunk&, v1::ServeOracleRequest* r) {
       for (std::size_t i = 0; i < 3; ++i) Poke(r->mutable_answers()->mutable_points(), i, 0.2);
     }},
    {"RAISED", [](const v1::QueryChunk& q, v1::ServeOracleRequest* r) { SayItFailed(q, "", r); }},
    {"INEXACT", [](const v1::QueryChunk& q,
                   v1::ServeOracleRequest* r) { SayItFailed(q, "ORACLE_PRECISION", r); }},
    {"TOUCHES_ZERO", [](const v1::QueryChunk& q,
                        v1::ServeOracleRequest* r) { SayItFailed(q, "ORACLE_TOUCHES_ZERO", r); }},
    {"WRONG_DERIVATIVE", [](const v1::QueryChunk& q,
                            v1::ServeOracleRequest* r) { SayItFailed(q, "ORACLE_DERIVATIVE", r); }},
};

class LiveFaultyExamineTest : public LiveExamineTest,
                              public ::testing::WithParamInterface<Fault> {};

TEST_P(LiveFaultyExamineTest, IsAFinding) {
  Start();
  Examination examination(stub_.get(), SpecOfSphere());
  RawWorker liar(stub_.get(), examination.Name(), [](const v1::QueryChunk& queries) {
    auto request = RawWorker::Truly(queries);
    GetParam().tell(queries, &*request);
    return request;
  });
  const grpc::Status status = examination.Finish();
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_FALSE(examination.report.ok());
  const v1::Finding* const finding = examination.Find(GetParam().finding);
  ASSERT_NE(finding, nullptr) << examination.report.text();
  EXPECT_EQ(finding->message().find('\x1b'), std::string::npos);
  EXPECT_FALSE(finding->advice().empty());
  EXPECT_EQ(examination.report.no_epsilon().reason(), "ORACLE_BREAKS_CONTRACT");
  EXPECT_NE(examination.report.no_epsilon().message().find(GetParam().finding), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Faults, LiveFaultyExamineTest, ::testing::ValuesIn(kFaults),
                         [](const auto& fault) { return fault.param.finding; });

TEST_F(LiveExamineTest, WhatCannotBeAskedIsAFindingWithoutAMesh) {
  Start();
  v1::MeshSpec full = SpecOfSphere();
  full.set_dimension(3);
  v1::MeshSpec nowhere = SpecOfSphere();
  nowhere.clear_bounding_box();
  nowhere.clear_seeds();
  for (const auto& [spec, code] :
       {std::pair(full, "BAD_DIMENSIONS"), std::pair(nowhere, "NO_WHEREABOUTS")}) {
    Examination examination(stub_.get(), spec);
    EXPECT_EQ(examination.Name(), "");
    ASSERT_TRUE(examination.Finish().ok());
    EXPECT_EQ(examination.codes, std::vector<std::string>{code});
    EXPECT_TRUE(examination.is_reported);
    EXPECT_FALSE(examination.report.ok());
  }
}

TEST_F(LiveExamineTest, WhatNoMeshMayHaveIsRefused) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.set_walls(65);
  Examination many_walls(stub_.get(), spec);
  EXPECT_EQ(many_walls.Name(), "");
  const grpc::Status status = many_walls.Finish();
  EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("walls"), std::string::npos) << status.error_message();
  spec = SpecOfSphere();
  spec.set_epsilon(-1);
  EXPECT_EQ(Examination(stub_.get(), spec).Finish().error_code(), StatusCode::INVALID_ARGUMENT);
}

TEST_F(LiveExamineTest, EndsWithItsCall) {
  Start();
  Examination examination(stub_.get(), SpecOfSphere());
  const std::string name = examination.Name();
  std::atomic<int> asked = 0;
  RawWorker worker(stub_.get(), name, [&](const v1::QueryChunk& queries) {
    if (++asked == 3) examination.Cancel();
    return RawWorker::Truly(queries);
  });
  EXPECT_EQ(examination.Finish().error_code(), StatusCode::CANCELLED);
  EXPECT_FALSE(examination.is_reported);
  EXPECT_TRUE(Goes(name));
  worker.Wait();
}

TEST_F(LiveExamineTest, EndsWhenItsMeshIsCancelled) {
  Start();
  Examination examination(stub_.get(), SpecOfSphere());
  grpc::ClientContext context;
  v1::CancelMeshRequest request;
  request.set_name(examination.Name());
  v1::Mesh mesh;
  ASSERT_TRUE(stub_->CancelMesh(&context, request, &mesh).ok());
  EXPECT_EQ(examination.Finish().error_code(), StatusCode::CANCELLED);
  EXPECT_TRUE(Goes(request.name()));
}

TEST_F(LiveExamineTest, GivesUpSoonOnAWorkerThatDoesNotCome) {
  Start();
  Examination hasty(stub_.get(), SpecOfSphere());
  ASSERT_NE(hasty.Name(), "");
  EXPECT_EQ(hasty.worker_wait, 10);
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_worker_wait_seconds(33);
  Examination patient(stub_.get(), spec);
  ASSERT_NE(patient.Name(), "");
  EXPECT_EQ(patient.worker_wait, 33);
}

TEST_F(LiveExamineTest, WaitsForAWorkerNoLongerThanAMesh) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_worker_wait_seconds(0.1);
  Examination examination(stub_.get(), spec);
  const std::string name = examination.Name();
  const grpc::Status status = examination.Finish();
  EXPECT_EQ(status.error_code(), StatusCode::FAILED_PRECONDITION) << status.error_message();
  EXPECT_EQ(ReasonIn(status), "NO_WORKER");
  EXPECT_TRUE(Goes(name));
}

TEST_F(LiveExamineTest, ASilentOracleIsAFinding) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_answer_seconds(0.05);
  Examination examination(stub_.get(), spec);
  RawWorker silent(stub_.get(), examination.Name(),
                   [](const v1::QueryChunk&) { return std::optional<v1::ServeOracleRequest>(); });
  const grpc::Status status = examination.Finish();
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_NE(examination.Find("RAISED"), nullptr) << examination.report.text();
  EXPECT_NE(examination.Find("RAISED")->message().find("answer_seconds"), std::string::npos);
}

TEST_F(LiveExamineTest, ASecondWorkerIsForWhenTheFirstHasLeft) {
  Start();
  Examination examination(stub_.get(), SpecOfSphere());
  const std::string name = examination.Name();
  std::atomic<int> asked = 0;
  RawWorker first(stub_.get(), name, [&](const v1::QueryChunk& queries) {
    const bool stays = ++asked < 5;
    return stays ? RawWorker::Truly(queries) : std::nullopt;
  });
  while (asked < 5) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  RawWorker beside(stub_.get(), name);
  EXPECT_EQ(beside.Wait().error_code(), StatusCode::RESOURCE_EXHAUSTED);
  first.SayNoMore();
  EXPECT_TRUE(first.Wait().ok());
  RawWorker second(stub_.get(), name);
  ASSERT_TRUE(examination.Finish().ok());
  EXPECT_TRUE(examination.report.ok()) << examination.report.text();
}

TEST_F(LiveExamineTest, CountsAmongTheMeshes) {
  Config config;
  config.max_meshes = 1;
  Start(config);
  Examination first(stub_.get(), SpecOfSphere());
  ASSERT_NE(first.Name(), "");
  Examination second(stub_.get(), SpecOfSphere());
  const grpc::Status status = second.Finish();
  EXPECT_EQ(status.error_code(), StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReasonIn(status), "LIMIT_EXCEEDED");
}

TEST_F(LiveExamineTest, IsNotRecorded) {
  Config config;
  config.data_dir = ::testing::TempDir() + "examined-" + std::to_string(getpid());
  std::filesystem::create_directories(config.data_dir);
  Start(config);
  {
    Examination examination(stub_.get(), SpecOfSphere());
    RawWorker worker(stub_.get(), examination.Name());
    ASSERT_TRUE(examination.Finish().ok());
    Examination unfinished(stub_.get(), SpecOfSphere());
    ASSERT_NE(unfinished.Name(), "");
    server_.reset();
    const grpc::Status status = unfinished.Finish();
    EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE) << status.error_message();
  }
  Start(config);
  grpc::ClientContext context;
  v1::ListMeshesResponse listed;
  ASSERT_TRUE(stub_->ListMeshes(&context, {}, &listed).ok());
  EXPECT_EQ(listed.meshes_size(), 0);
}

}  // namespace
}  // namespace stellate::server::testing
