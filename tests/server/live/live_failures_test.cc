// Oracles that lie, fail, vanish or fall silent, against a live server.

#include <limits>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using grpc::StatusCode;

struct Lie {
  const char* name;
  const char* reason;
  // True: this chunk has what the lie needs, and it was told.
  bool (*tell)(const v1::QueryChunk& queries, v1::AnswerChunk* answer);
};

bool IsFlat(const v1::QueryChunk& queries) {
  return queries.kind() == v1::QUERY_KIND_INTERSECT_FLAT;
}

const Lie kLies[] = {
    {"OnePointTooFew", "ORACLE_SHAPE",
     [](const v1::QueryChunk&, v1::AnswerChunk* a) {
       auto* const points = a->mutable_points();
       points->set_shape(0, points->shape(0) - 1);
       points->mutable_data()->resize(points->data().size() - 24);
       return true;
     }},
    {"BytesMissing", "ORACLE_SHAPE",
     [](const v1::QueryChunk&, v1::AnswerChunk* a) {
       a->mutable_points()->mutable_data()->pop_back();
       return true;
     }},
    {"GiantShape", "ORACLE_SHAPE",
     [](const v1::QueryChunk&, v1::AnswerChunk* a) {
       a->mutable_points()->set_shape(0, 4294967295u);
       return true;
     }},
    {"NoTangents", "ORACLE_SHAPE",
     [](const v1::QueryChunk& q, v1::AnswerChunk* a) {
       a->clear_tangents();
       return q.want_tangents();
     }},
    {"NaN", "ORACLE_NOT_FINITE",
     [](const v1::QueryChunk&, v1::AnswerChunk* a) {
       Poke(a->mutable_points(), 1, std::numeric_limits<double>::quiet_NaN());
       return true;
     }},
    {"Infinity", "ORACLE_NOT_FINITE",
     [](const v1::QueryChunk&, v1::AnswerChunk* a) {
       Poke(a->mutable_points(), 0, std::numeric_limits<double>::infinity());
       return true;
     }},
    {"OffTheFlat", "ORACLE_OFF_FLAT",
     [](const v1::QueryChunk& q, v1::AnswerChunk* a) {
       if (!IsFlat(q)) return false;
       // A step along the first tangent of the flat's T leaves the flat.
       const auto basis = MatrixFromProto(q.bases(), 6, q.bases().shape(0));
       const auto radii = MatrixFromProto(q.radii(), q.radii().shape(0), 1);
       const auto centers = MatrixFromProto(q.points(), 3, q.points().shape(0));
       for (int i = 0; i < 3; ++i) {
         Poke(a->mutable_points(), i, centers(i, 0) + 0.5 * radii(0, 0) * basis(2 * i, 0));
       }
       a->mutable_found()->at(0) = '\1';
       return true;
     }},
    {"OutsideTheRadius", "ORACLE_OUTSIDE_RADIUS",
     [](const v1::QueryChunk& q, v1::AnswerChunk* a) {
       if (!IsFlat(q)) return false;
       const Eigen::MatrixXd basis = MatrixFromProto(q.bases(), 6, q.bases().shape(0)).col(0);
       const auto radii = MatrixFromProto(q.radii(), q.radii().shape(0), 1);
       const auto centers = MatrixFromProto(q.points(), 3, q.points().shape(0));
       const Eigen::Vector3d u(basis(0), basis(2), basis(4)), v(basis(1), basis(3), basis(5));
       const Eigen::Vector3d far = centers.col(0) + 3 * radii(0, 0) * u.cross(v);
       for (int i = 0; i < 3; ++i) Poke(a->mutable_points(), i, far[i]);
       a->mutable_found()->at(0) = '\1';
       return true;
     }},
    {"TangentsNotOrthonormal", "ORACLE_BAD_TANGENT",
     [](const v1::QueryChunk& q, v1::AnswerChunk* a) {
       if (!q.want_tangents() || a->found()[0] == '\0') return false;
       Poke(a->mutable_tangents(), 0, 2.0);
       return true;
     }},
};

class LyingOracleTest : public LiveServer, public ::testing::WithParamInterface<Lie> {};

TEST_P(LyingOracleTest, FailsItsMeshAndNoOther) {
  Start();
  const std::string name = CreateSphere();
  const std::string other = CreateSphere();
  RawWorker liar(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    *request.mutable_answers() = TrueAnswer(queries);
    v1::AnswerChunk lie = request.answers();
    if (GetParam().tell(queries, &lie)) *request.mutable_answers() = lie;
    return std::optional(request);
  });
  const grpc::Status status = liar.Wait();
  EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(ReasonIn(status), GetParam().reason) << status.error_message();
  const v1::Mesh final = WatchToEnd(name);
  EXPECT_EQ(final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(final.report().failure().reason(), GetParam().reason);
  // The worker is told the lease and the row besides, which are nothing to the mesh's owner.
  EXPECT_TRUE(status.error_message().starts_with(final.report().failure().message() + " (lease "))
      << status.error_message();
  EXPECT_FALSE(final.report().certificate().certified());

  RawWorker honest(stub_.get(), other);
  EXPECT_EQ(WatchToEnd(other).state(), v1::MESH_STATE_SUCCEEDED);
}

INSTANTIATE_TEST_SUITE_P(Lies, LyingOracleTest, ::testing::ValuesIn(kLies),
                         [](const auto& lie) { return lie.param.name; });

class LiveFailuresTest : public LiveServer {};

TEST_F(LiveFailuresTest, ABadAnswerIsNamedByItsLeaseAndRow) {
  Start();
  std::string lease;
  std::string row;
  RawWorker liar(stub_.get(), CreateSphere(), [&](const v1::QueryChunk& queries) {
    auto request = RawWorker::Truly(queries);
    v1::AnswerChunk* const answer = request->mutable_answers();
    // Not the first chunk, so that the round's index of the query is not its row.
    const auto last = queries.points().shape(0) - 1;
    const bool lies = row.empty() && queries.lease() > 2 && last > 1;
    if (!lies || answer->found()[last] == '\0') return request;
    Poke(answer->mutable_points(), 3 * last + 1, std::numeric_limits<double>::quiet_NaN());
    lease = std::to_string(queries.lease());
    row = std::to_string(last);
    return request;
  });
  const grpc::Status status = liar.Wait();
  ASSERT_EQ(ReasonIn(status), "ORACLE_NOT_FINITE") << status.error_message();
  ASSERT_FALSE(row.empty());
  EXPECT_EQ(MetadataIn(status, "lease"), lease);
  EXPECT_EQ(MetadataIn(status, "row"), row);
  EXPECT_TRUE(status.error_message().ends_with(" (lease " + lease + ", row " + row + ")"))
      << status.error_message();
}

TEST_F(LiveFailuresTest, AnAnswerOfTheWrongShapeIsNamedByItsLeaseAndField) {
  Start();
  RawWorker liar(stub_.get(), CreateSphere(), [&](const v1::QueryChunk& queries) {
    auto request = RawWorker::Truly(queries);
    if (queries.lease() > 1) request->mutable_answers()->mutable_found()->push_back('\1');
    return request;
  });
  const grpc::Status status = liar.Wait();
  ASSERT_EQ(ReasonIn(status), "ORACLE_SHAPE") << status.error_message();
  EXPECT_EQ(MetadataIn(status, "lease"), "2");
  EXPECT_EQ(MetadataIn(status, "row"), "");
  EXPECT_EQ(FieldIn(status), "answers.found");
}

TEST_F(LiveFailuresTest, AnOracleThatRaisesFailsItsMeshInItsOwnWords) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    request.mutable_failure()->set_lease(queries.lease());
    request.mutable_failure()->set_message("ZeroDivisionError: division by zero");
    return std::optional(request);
  });
  const grpc::Status status = worker.Wait();
  EXPECT_EQ(status.error_code(), StatusCode::ABORTED);
  EXPECT_EQ(ReasonIn(status), "ORACLE_FAILED");
  const v1::Mesh final = WatchToEnd(name);
  EXPECT_EQ(final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(final.report().failure().reason(), "ORACLE_FAILED");
  EXPECT_EQ(final.report().failure().message(), "ZeroDivisionError: division by zero");
}

TEST_F(LiveFailuresTest, AClosestPointThatMovesItsOwnAnswerIsFound) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    *request.mutable_answers() = TrueAnswer(queries);
    if (IsFlat(queries)) return std::optional(request);
    // Half way to the sphere: each answer is moved again when asked about.
    const auto n = static_cast<Eigen::Index>(queries.points().shape(0));
    const Eigen::MatrixXd half = (MatrixFromProto(queries.points(), 3, n) +
                                  MatrixFromProto(request.answers().points(), 3, n)) /
                                 2;
    ToProto(half.data(), {static_cast<std::size_t>(n), 3},
            request.mutable_answers()->mutable_points());
    return std::optional(request);
  });
  const grpc::Status status = worker.Wait();
  EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(ReasonIn(status), "ORACLE_NOT_IDEMPOTENT") << status.error_message();
  EXPECT_EQ(WatchToEnd(name).report().failure().reason(), "ORACLE_NOT_IDEMPOTENT");
}

TEST_F(LiveFailuresTest, SeedsWithoutAClosestPointFailTheMesh) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    *request.mutable_answers() = TrueAnswer(queries);
    request.mutable_answers()->mutable_found()->assign(queries.points().shape(0), '\0');
    return std::optional(request);
  });
  const v1::Mesh final = WatchToEnd(name);
  EXPECT_EQ(final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(final.report().failure().reason(), "NO_SEEDS");
}

TEST_F(LiveFailuresTest, AnOracleThatNeverAnswersIsGivenUp) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_answer_seconds(0.05);
  v1::Mesh mesh;
  ASSERT_TRUE(Create(spec, &mesh).ok());
  RawWorker silent(
      stub_.get(), mesh.name(),
      [](const v1::QueryChunk&) -> std::optional<v1::ServeOracleRequest> { return {}; });
  const v1::Mesh final = WatchToEnd(mesh.name());
  EXPECT_EQ(final.state(), v1::MESH_STATE_FAILED);
  EXPECT_EQ(final.report().failure().reason(), "ANSWER_TIMEOUT");
  EXPECT_TRUE(silent.Wait().ok());
  EXPECT_EQ(silent.over(), "MESH_STATE_FAILED");
}

TEST_F(LiveFailuresTest, AMeshThatNobodyServesIsGivenUp) {
  Start();
  v1::MeshSpec spec = SpecOfSphere();
  spec.mutable_limits()->set_worker_wait_seconds(0.05);
  v1::Mesh mesh;
  ASSERT_TRUE(Create(spec, &mesh).ok());
  EXPECT_EQ(WatchToEnd(mesh.name()).report().failure().reason(), "NO_WORKER");
  const grpc::Status late = RawWorker(stub_.get(), mesh.name()).Wait();
  EXPECT_EQ(late.error_code(), StatusCode::FAILED_PRECONDITION) << "the mesh is over";
}

// A worker that leaves with work undone: by saying so, or by vanishing.
TEST_F(LiveFailuresTest, AnotherWorkerTakesOver) {
  Start();
  for (const bool politely : {true, false}) {
    const std::string name = CreateSphere();
    std::atomic<int> answered{0};
    RawWorker quitter(stub_.get(), name,
                      [&](const v1::QueryChunk& queries) -> std::optional<v1::ServeOracleRequest> {
                        if (answered >= 3) return {};
                        ++answered;
                        return RawWorker::Truly(queries);
                      });
    while (quitter.chunks() <= 3) std::this_thread::yield();
    if (politely) {
      quitter.SayNoMore();
    } else {
      quitter.Vanish();
    }
    EXPECT_EQ(quitter.Wait().ok(), politely);
    RawWorker heir(stub_.get(), name);
    const v1::Mesh final = WatchToEnd(name);
    EXPECT_EQ(final.state(), v1::MESH_STATE_SUCCEEDED);
    EXPECT_TRUE(final.report().certificate().certified());
    EXPECT_TRUE(heir.Wait().ok());
    EXPECT_EQ(heir.over(), "MESH_STATE_SUCCEEDED");
  }
}

// Streams that break the order of messages end so, and the mesh is served by others.
TEST_F(LiveFailuresTest, MessagesOutOfOrderEndTheStreamAlone) {
  Start();
  const std::string name = CreateSphere();
  v1::ServeOracleRequest hello, answers, failure, nothing, garbled;
  hello.mutable_hello()->set_mesh(name);
  answers.mutable_answers()->set_lease(77);
  failure.mutable_failure()->set_message("before hello");
  garbled.mutable_failure()->set_message("no UTF-8: \xff");  // which no parser takes
  const std::vector<v1::ServeOracleRequest> scripts[] = {
      {answers},        {failure},        {nothing}, {hello, hello},
      {hello, answers}, {hello, nothing}, {garbled}, {hello, garbled}};
  for (const auto& script : scripts) {
    grpc::ClientContext context;
    const auto stream = stub_->ServeOracle(&context);
    for (const auto& message : script) stream->Write(message);
    v1::ServeOracleResponse response;
    while (stream->Read(&response)) {
    }
    const grpc::Status status = stream->Finish();
    EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
    EXPECT_EQ(ReasonIn(status), "OUT_OF_ORDER") << status.error_message();
  }
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

// Whether or not others of its leases wait for their answers.
TEST_F(LiveFailuresTest, ASecondAnswerToALeaseEndsTheStream) {
  Start();
  const std::string name = CreateSphere(0.1);
  for (const int chunks : {1, 5}) {
    grpc::ClientContext context;
    const auto stream = stub_->ServeOracle(&context);
    v1::ServeOracleRequest request;
    request.mutable_hello()->set_mesh(name);
    stream->Write(request);
    v1::ServeOracleResponse response;
    for (int left = chunks; left > 0 && stream->Read(&response);) {
      if (!response.has_queries()) continue;
      *request.mutable_answers() = TrueAnswer(response.queries());
      stream->Write(request);
      if (--left == 0) stream->Write(request);
    }
    while (stream->Read(&response)) {
    }
    const grpc::Status status = stream->Finish();
    EXPECT_EQ(ReasonIn(status), "OUT_OF_ORDER") << status.error_message();
  }
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

TEST_F(LiveFailuresTest, WhatAnOracleSaysCommandsNobodysTerminal) {
  Start();
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name, [](const v1::QueryChunk& queries) {
    v1::ServeOracleRequest request;
    request.mutable_failure()->set_lease(queries.lease());
    request.mutable_failure()->set_message("\033[2Jno point\ncertificate  PROVED\u202e");
    return std::optional(request);
  });
  EXPECT_EQ(WatchToEnd(name).report().failure().message(), " [2Jno point\n  certificate  PROVED ");
}

TEST_F(LiveFailuresTest, AStreamWithoutHelloIsClosed) {
  Config config;
  config.hello_seconds = 0.01;
  Start(config);
  grpc::ClientContext context;
  const auto stream = stub_->ServeOracle(&context);
  v1::ServeOracleResponse response;
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(ReasonIn(stream->Finish()), "OUT_OF_ORDER");
}

// Answers to leases that were answered before: the stream ends, nothing grows, the mesh goes on.
TEST_F(LiveFailuresTest, AFloodOfAnswersEndsTheStream) {
  Start();
  const std::string name = CreateSphere();
  grpc::ClientContext context;
  const auto stream = stub_->ServeOracle(&context);
  v1::ServeOracleRequest hello, flood;
  hello.mutable_hello()->set_mesh(name);
  stream->Write(hello);
  v1::ServeOracleResponse response;
  while (stream->Read(&response) && !response.has_queries()) {
  }
  *flood.mutable_answers() = TrueAnswer(response.queries());
  for (int i = 0; i < 1000 && stream->Write(flood); ++i) {
  }
  while (stream->Read(&response)) {
  }
  EXPECT_EQ(ReasonIn(stream->Finish()), "OUT_OF_ORDER");
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

}  // namespace
}  // namespace stellate::server::testing
