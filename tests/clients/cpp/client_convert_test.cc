#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "net/channel.h"
#include "run/delta_mesh.h"
#include "stellate/catalogue.h"
#include "stellate/pointwise.h"
#include "stellate/rpc/status_details.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {
namespace {

TEST(Arrays, TravelAndComeBack) {
  const Eigen::MatrixXd columns = Eigen::MatrixXd::Random(6, 5);
  v1::Array array;
  ToArray(columns, {3, 2}, &array);
  ASSERT_EQ(array.shape_size(), 3);
  EXPECT_EQ(array.shape(0), 5u);
  EXPECT_EQ(array.data().size(), 6u * 5 * 8);
  const auto back = FromArray(array, {3, 2});
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(*back, columns);
}

TEST(Arrays, OfTheWrongShapeAreErrors) {
  v1::Array array;
  ToArray(Eigen::MatrixXd::Ones(6, 5), {3, 2}, &array);
  EXPECT_FALSE(FromArray(array, {6}).has_value());
  EXPECT_FALSE(FromArray(array, {2, 3}).has_value());
  EXPECT_FALSE(FromArray(array, {}).has_value());
  v1::Array cut = array;
  cut.mutable_data()->pop_back();
  EXPECT_FALSE(FromArray(cut, {3, 2}).has_value());
  v1::Array huge = array;
  huge.set_shape(0, std::numeric_limits<std::uint32_t>::max());
  EXPECT_FALSE(FromArray(huge, {3, 2}).has_value());
  const auto empty = FromArray(v1::Array(), {3});
  ASSERT_TRUE(empty.has_value());
  EXPECT_EQ(empty->cols(), 0);
}

// Each plain field of a message gets a number of its own.
void FillWithNumbers(google::protobuf::Message* message) {
  using Field = google::protobuf::FieldDescriptor;
  const auto* reflection = message->GetReflection();
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const Field* field = message->GetDescriptor()->field(i);
    if (field->is_repeated()) {
      if (field->cpp_type() == Field::CPPTYPE_INT64)
        reflection->AddInt64(message, field, 100 + field->number());
    } else if (field->cpp_type() == Field::CPPTYPE_UINT32) {
      reflection->SetUInt32(message, field, static_cast<std::uint32_t>(100 + field->number()));
    } else if (field->cpp_type() == Field::CPPTYPE_UINT64) {
      reflection->SetUInt64(message, field, static_cast<std::uint64_t>(100 + field->number()));
    } else if (field->cpp_type() == Field::CPPTYPE_INT64) {
      reflection->SetInt64(message, field, 100 + field->number());
    } else if (field->cpp_type() == Field::CPPTYPE_DOUBLE) {
      reflection->SetDouble(message, field, 100 + field->number());
    }
  }
}

void ExpectInJson(const google::protobuf::Message& message, const std::string& json) {
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i) {
    const auto* field = message.GetDescriptor()->field(i);
    std::string wanted = "\"" + field->name() + "\": ";
    const auto type = field->cpp_type();
    using Field = google::protobuf::FieldDescriptor;
    const bool number = type == Field::CPPTYPE_UINT64 || type == Field::CPPTYPE_INT64 ||
                        type == Field::CPPTYPE_DOUBLE;
    if (number) {
      const std::string value = std::to_string(100 + field->number());
      wanted += field->is_repeated() ? '[' + value + ']' : value;
    }
    EXPECT_NE(json.find(wanted), std::string::npos) << wanted << " in\n" << json;
  }
}

// A field that is new in the protocol is not forgotten on the way to the user.
TEST(Reports, HaveEveryFieldOfTheProtocols) {
  v1::Mesh mesh;
  FillWithNumbers(mesh.mutable_report()->mutable_certificate());
  FillWithNumbers(mesh.mutable_report()->mutable_counts());
  FillWithNumbers(mesh.mutable_report());
  const std::string json = ToJson(ReportOf(mesh));
  ExpectInJson(mesh.report().certificate(), json);
  ExpectInJson(mesh.report().counts(), json);
  EXPECT_NE(json.find("\"elapsed_seconds\": 105"), std::string::npos);
}

TEST(ServerInfo, HasEveryFieldOfTheProtocols) {
  v1::ServerInfo info;
  FillWithNumbers(&info);
  info.set_version("1.2.3");
  info.add_protocols("stellate.v1");
  const ServerHealth health = HealthOf(info);
  // As many as ServerHealth has members, or this does not compile.
  const auto& [serving, version, protocols, max_dimension, max_ambient_dimension, max_meshes,
               max_vertices, max_rounds, max_message_bytes, owner_meshes, max_memory_bytes,
               owner_memory_bytes, max_workers, max_watchers, check_share] = health;
  EXPECT_EQ(v1::ServerInfo::descriptor()->field_count(), 14);
  EXPECT_FALSE(serving);
  EXPECT_EQ(version, "1.2.3");
  EXPECT_EQ(protocols, std::vector<std::string>{"stellate.v1"});
  EXPECT_EQ(max_dimension, 103u);
  EXPECT_EQ(max_ambient_dimension, 104u);
  EXPECT_EQ(max_vertices, 105u);
  EXPECT_EQ(max_rounds, 106u);
  EXPECT_EQ(max_meshes, 107u);
  EXPECT_EQ(max_message_bytes, 108u);
  EXPECT_EQ(owner_meshes, 109u);
  EXPECT_EQ(max_memory_bytes, 110u);
  EXPECT_EQ(owner_memory_bytes, 111u);
  EXPECT_EQ(max_workers, 112u);
  EXPECT_EQ(max_watchers, 113u);
  EXPECT_EQ(check_share, 114);
}

TEST(DeltaMesh, FindsASimplexThatCameTwice) {
  auto builder = DeltaMesh::Create(1, 1);
  for (const std::uint64_t revision : {1, 2}) {
    v1::DeltaChunk chunk;
    chunk.set_complete(true);
    v1::MeshDelta& delta = *chunk.mutable_delta();
    delta.set_revision(revision);
    if (revision == 1) ToArray(Eigen::MatrixXd::Zero(1, 2), {1}, delta.mutable_points());
    delta.mutable_added()->add_shape(1);
    delta.mutable_added()->add_shape(2);
    const std::uint32_t edge[] = {0, 1};
    delta.mutable_added()->set_data(edge, sizeof edge);
    ASSERT_TRUE(builder->Absorb(std::move(chunk)).has_value());
    EXPECT_EQ(builder->Take().has_value(), revision == 1);
  }
  EXPECT_EQ(builder->Take().error().reason, "PROTOCOL");
}

TEST(Enums, OfANewerServerAreUnknown) {
  v1::Mesh mesh;
  mesh.set_state(static_cast<v1::MeshState>(99));
  mesh.mutable_progress()->set_phase(static_cast<v1::Phase>(99));
  mesh.mutable_report()->set_termination(static_cast<v1::Termination>(99));
  mesh.mutable_report()->mutable_certificate()->set_level(static_cast<v1::CertificateLevel>(99));
  const MeshStatus status = StatusOf(mesh);
  EXPECT_STREQ(MeshStateName(status.state), "UNKNOWN");
  EXPECT_TRUE(status.over());
  EXPECT_STREQ(PhaseName(status.progress.phase), "UNKNOWN");
  const Report report = ReportOf(mesh);
  EXPECT_STREQ(TerminationName(report.termination), "UNKNOWN");
  EXPECT_STREQ(CertificateLevelName(report.certificate.level), "UNKNOWN");
}

TEST(Spec, CarriesWhatTheOracleSaysOfItself) {
  class Telling final : public PointwiseOracle {
   public:
    Telling() : PointwiseOracle(1, 2) {}
    bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
      y = x.normalized();
      return true;
    }
    void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
      tangent = Eigen::Vector2d(-y[1], y[0]);
    }
    std::string about() const override { return words; }
    std::string words = "a circle by trade";
  } oracle;
  EXPECT_EQ(ToSpec(oracle, {})->oracle().about(), "a circle by trade");
  std::string longest;
  for (int i = 0; i < 300; ++i) longest += "\u00e9";
  oracle.words = longest + "and more";
  EXPECT_EQ(ToSpec(oracle, {})->oracle().about(), longest) << "what a server takes";
  EXPECT_EQ(ToSpec(*MakeManifold("torus").value(), {})->oracle().about(), "");
}

TEST(Spec, CarriesWhatIsGivenAndNothingElse) {
  const auto manifold = MakeManifold("torus").value();
  MeshOptions options;
  options.epsilon = 0.25;
  const auto plain = ToSpec(*manifold, options);
  ASSERT_TRUE(plain.has_value());
  EXPECT_EQ(plain->dimension(), 2u);
  EXPECT_EQ(plain->ambient_dimension(), 3u);
  EXPECT_EQ(plain->epsilon(), 0.25);
  EXPECT_TRUE(plain->oracle().tangent_basis() && plain->oracle().intersect_flat());
  EXPECT_TRUE(plain->oracle().local_size());
  EXPECT_FALSE(ToSpec(*MakeManifold("tanglecube").value(), options)->oracle().local_size());
  EXPECT_FALSE(plain->criteria().has_sliver_bound() || plain->criteria().has_candidates());
  EXPECT_EQ(plain->bounding_box().lower().shape(0), 3u);
  EXPECT_EQ(plain->bounding_box().lower().shape_size(), 1);
  EXPECT_FALSE(plain->has_seeds());
  EXPECT_EQ(plain->components(), 0u);
  EXPECT_EQ(plain->audit(), v1::AUDIT_UNSPECIFIED);
  options.sliver_bound = 0;
  options.max_vertices = 7;
  options.components = 2;
  options.thorough_audit = true;
  const auto fuller = ToSpec(*manifold, options);
  ASSERT_TRUE(fuller.has_value());
  EXPECT_TRUE(fuller->criteria().has_sliver_bound());
  EXPECT_EQ(fuller->limits().max_vertices(), 7u);
  EXPECT_EQ(fuller->components(), 2u);
  EXPECT_EQ(fuller->audit(), v1::AUDIT_THOROUGH);
}

TEST(Spec, KnowsWhatGoodShapeIs) {
  const auto rotations = MakeManifold("so3").value();
  MeshOptions options;
  options.good_shape = true;
  EXPECT_EQ(ToSpec(*rotations, options)->criteria().sliver_bound(), 0.3);
  options.sliver_bound = 0.28;
  EXPECT_EQ(ToSpec(*rotations, options).error().message,
            "good_shape says what sliver_bound is: give one of them");
  options.sliver_bound.reset();
  const auto refused = ToSpec(*MakeManifold("torus").value(), options);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().message, "good_shape is for k = 3, and the manifold has k = 2");
}

TEST(Spec, RefusesWhatTheWireCannotSay) {
  const auto manifold = MakeManifold("torus").value();
  MeshOptions options;
  options.workers = 0;
  const auto spec = ToSpec(*manifold, options);
  ASSERT_FALSE(spec.has_value());
  EXPECT_EQ(spec.error().code, ErrorCode::kRefused);
  EXPECT_NE(spec.error().message.find("workers is 0"), std::string::npos);
}

TEST(Statuses, KeepTheReasonAndTellWhoseFault) {
  rpc::ErrorInfo info;
  info.set_reason("ORACLE_OFF_FLAT");
  info.set_domain("stellate.v1");
  rpc::Status details;
  google::protobuf::Any* any = details.add_details();
  any->set_type_url("type.googleapis.com/google.rpc.ErrorInfo");
  any->set_value(info.SerializeAsString());
  const Error oracle = FromStatus(
      grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "query 3 ...", details.SerializeAsString()));
  EXPECT_EQ(oracle.code, ErrorCode::kOracleFailed);
  EXPECT_EQ(oracle.reason, "ORACLE_OFF_FLAT");
  EXPECT_EQ(oracle.message, "query 3 ...");
  EXPECT_EQ(FromStatus(grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "")).code,
            ErrorCode::kRefused);
  EXPECT_EQ(FromStatus(grpc::Status(grpc::StatusCode::UNAVAILABLE, "")).code,
            ErrorCode::kServerFailed);
  EXPECT_EQ(FromStatus(grpc::Status(grpc::StatusCode::NOT_FOUND, "", "no protobuf")).reason, "");
}

// In gRPC's own words; python_test_safety has real servers say them.
TEST(FromStatus, NamesTheFlagThatHelps) {
  using enum grpc::StatusCode;
  const auto said = [](grpc::StatusCode code, const std::string& words) {
    return FromStatus(grpc::Status(code, words)).message;
  };
  const auto names = [](const std::string& message, const char* words) {
    return message.find(words) != std::string::npos;
  };
  const std::string connect = "failed to connect to all addresses; last error: ";
  EXPECT_TRUE(names(said(UNAUTHENTICATED, "no token came"), "--token-file"));
  EXPECT_TRUE(names(said(UNAVAILABLE, connect + "Socket closed"), "want TLS? --tls"));
  EXPECT_TRUE(names(said(UNAVAILABLE, connect + "wrong version number"), "plain text"));
  EXPECT_TRUE(
      names(said(UNAVAILABLE, connect + "certificate verify failed"), "--tls-ca FILE names"));
  EXPECT_EQ(said(UNAVAILABLE, "Socket closed"), "Socket closed");  // it was there
  EXPECT_TRUE(names(said(UNAVAILABLE, connect + "Connection refused"), "no server listens there"));
  EXPECT_EQ(said(UNAVAILABLE, connect + "No route to host"), connect + "No route to host");
}

v1::DeltaChunk Delta(std::uint64_t revision, std::uint64_t first, const Eigen::MatrixXd& points,
                     const std::vector<std::uint32_t>& added,
                     const std::vector<std::uint32_t>& removed, bool complete = true) {
  v1::DeltaChunk chunk;
  chunk.set_complete(complete);
  v1::MeshDelta& delta = *chunk.mutable_delta();
  delta.set_revision(revision);
  delta.set_first_vertex(first);
  ToArray(points, {2}, delta.mutable_points());
  for (const auto& [ids, array] :
       {std::pair(&added, delta.mutable_added()), std::pair(&removed, delta.mutable_removed())}) {
    array->add_shape(static_cast<std::uint32_t>(ids->size() / 2));
    array->add_shape(2);
    array->set_data(ids->data(), ids->size() * 4);
  }
  return chunk;
}

// Neither a revision without an end nor revisions without an end.
TEST(DeltaMesh, AServerThatSendsOnAndOnIsEndedAtSomePoint) {
  for (const bool complete : {false, true}) {
    auto builder = DeltaMesh::Create(1, 2, /*boundary_only=*/false, /*most_bytes=*/1 << 20);
    ASSERT_TRUE(builder.has_value());
    Expected<void> ok;
    std::uint64_t sent = 0;
    for (; ok && sent < (1 << 20); sent += 1000) {
      v1::DeltaChunk chunk =
          Delta(complete ? sent / 1000 + 1 : 1, sent, Eigen::MatrixXd::Zero(2, 1000), {}, {});
      chunk.set_complete(complete);
      ok = builder->Absorb(std::move(chunk));
    }
    ASSERT_FALSE(ok);
    EXPECT_EQ(ok.error().reason, "LIMIT_EXCEEDED");
    EXPECT_LE(sent * 16, 2u << 20);
  }
}

TEST(DeltaMesh, EndsWithWhatWasAddedAndNotRemoved) {
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  const Eigen::MatrixXd points = Eigen::MatrixXd::Random(2, 4);
  ASSERT_TRUE(builder->Absorb(Delta(1, 0, points.leftCols(3), {0, 1, 1, 2, 0, 2}, {})));
  ASSERT_TRUE(builder->Absorb(Delta(2, 3, points.rightCols(1), {2, 3, 0, 3}, {0, 2, 0, 1})));
  ASSERT_TRUE(builder->Absorb(Delta(5, 4, Eigen::MatrixXd(2, 0), {0, 1}, {})));  // it comes back
  const Mesh mesh = *builder->Take();
  EXPECT_EQ(mesh.points, points);
  SimplexMatrix expected(2, 4);
  expected << 0, 0, 1, 2, 1, 3, 2, 3;
  EXPECT_EQ(mesh.simplices, expected);
}

TEST(DeltaMesh, StaysRightThroughALongHistory) {
  // A hundred edges come and go five hundred times.
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  ASSERT_TRUE(builder->Absorb(Delta(1, 0, Eigen::MatrixXd::Zero(2, 200), {0, 1}, {})));
  for (std::uint32_t step = 0; step < 1000; ++step) {
    std::vector<std::uint32_t> added, removed;
    for (std::uint32_t i = 0; i < 100; ++i) {
      std::vector<std::uint32_t>& ids = step % 2 == 0 ? added : removed;
      ids.insert(ids.end(), {i, i + 100});
    }
    ASSERT_TRUE(builder->Absorb(Delta(2 + step, 200, Eigen::MatrixXd(2, 0), added, removed)));
  }
  const Mesh mesh = *builder->Take();
  ASSERT_EQ(mesh.simplices.cols(), 1);
  EXPECT_EQ(mesh.simplices(1, 0), 1u);
}

TEST(DeltaMesh, TakesARevisionOnceAndWhole) {
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  const Eigen::MatrixXd points = Eigen::MatrixXd::Random(2, 3);
  ASSERT_TRUE(builder->Absorb(Delta(3, 0, points.leftCols(2), {0, 1}, {})));
  // Cut short in the middle of revision 5, and sent again as 6.
  ASSERT_TRUE(builder->Absorb(Delta(5, 2, points.rightCols(1), {}, {0, 1}, false)));
  EXPECT_EQ(builder->revision(), 3u);
  EXPECT_EQ(builder->Take()->points.cols(), 2);
  builder->ForgetPending();
  ASSERT_TRUE(builder->Absorb(Delta(6, 2, points.rightCols(1), {0, 2}, {0, 1})));
  EXPECT_EQ(builder->revision(), 6u);
  const Mesh mesh = *builder->Take();
  EXPECT_EQ(mesh.points, points);
  ASSERT_EQ(mesh.simplices.cols(), 1);
  EXPECT_EQ(mesh.simplices(1, 0), 2u);
  // What it has already is refused, and so is another revision before one is complete.
  EXPECT_FALSE(builder->Absorb(Delta(6, 3, Eigen::MatrixXd(2, 0), {1, 2}, {})));
  ASSERT_TRUE(builder->Absorb(Delta(7, 3, Eigen::MatrixXd(2, 0), {1, 2}, {}, false)));
  EXPECT_FALSE(builder->Absorb(Delta(8, 3, Eigen::MatrixXd(2, 0), {}, {})));
}

TEST(DeltaMesh, LabelsStayWithTheirSimplices) {
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  const auto labelled = [](v1::DeltaChunk chunk, const std::string& labels) {
    chunk.mutable_delta()->set_added_labels(labels);
    return chunk;
  };
  const Eigen::MatrixXd points = Eigen::MatrixXd::Random(2, 4), none(2, 0);
  ASSERT_TRUE(
      builder->Absorb(labelled(Delta(1, 0, points, {2, 3, 0, 1, 1, 2}, {}), std::string{3, 1, 2})));
  EXPECT_EQ(builder->Take()->labels, (std::vector<std::uint8_t>{1, 2, 3}));
  // 0 1 goes, its place is taken by 0 3, and 1 2 comes again with another label.
  ASSERT_TRUE(
      builder->Absorb(labelled(Delta(2, 4, none, {0, 3, 1, 2}, {0, 1, 1, 2}), std::string{4, 5})));
  EXPECT_EQ(builder->Take()->labels, (std::vector<std::uint8_t>{4, 5, 3}));
  EXPECT_FALSE(builder->Absorb(labelled(Delta(3, 4, none, {0, 1}, {}), std::string{1, 1, 1})));
  auto plain = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(plain->Absorb(Delta(1, 0, points, {0, 1}, {})));
  EXPECT_TRUE(plain->Take()->labels.empty());
}

TEST(DeltaMesh, TheBoundaryAloneHasTwoLabelsPerSimplexAndPlainMeshesHaveNot) {
  const auto labelled = [](v1::DeltaChunk chunk, const std::string& labels) {
    chunk.mutable_delta()->set_added_labels(labels);
    return chunk;
  };
  const Eigen::MatrixXd points = Eigen::MatrixXd::Random(2, 4), none(2, 0);
  auto builder = DeltaMesh::Create(1, 2, /*boundary_only=*/true);
  ASSERT_TRUE(builder.has_value());
  ASSERT_TRUE(builder->Absorb(
      labelled(Delta(1, 0, points, {2, 3, 0, 1, 1, 2}, {}), std::string{3, 0, 1, 0, 0, 2})));
  Mesh mesh = *builder->Take();
  EXPECT_EQ(mesh.sides, (std::vector<Sides>{{1, 0}, {0, 2}, {3, 0}}));
  EXPECT_TRUE(mesh.labels.empty());
  // 0 1 goes, its place is taken by 0 3, and 1 2 comes again with other labels.
  ASSERT_TRUE(builder->Absorb(
      labelled(Delta(2, 4, none, {0, 3, 1, 2}, {0, 1, 1, 2}), std::string{4, 1, 1, 4})));
  mesh = *builder->Take();
  EXPECT_EQ(mesh.sides, (std::vector<Sides>{{4, 1}, {1, 4}, {3, 0}}));
  for (const std::string& wrong : {std::string(), std::string{1}, std::string{1, 2, 3}}) {
    auto other = DeltaMesh::Create(1, 2, /*boundary_only=*/true);
    EXPECT_FALSE(other->Absorb(labelled(Delta(1, 0, points, {0, 1}, {}), wrong))) << wrong.size();
  }
  auto plain = DeltaMesh::Create(1, 2);
  EXPECT_FALSE(plain->Absorb(labelled(Delta(1, 0, points, {0, 1}, {}), std::string{1, 2})));
}

TEST(DeltaMesh, BeginsAnewWhenTheServerDoes) {
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  const Eigen::MatrixXd points = Eigen::MatrixXd::Random(2, 3);
  ASSERT_TRUE(builder->Absorb(Delta(7, 0, points, {0, 1}, {})));
  ASSERT_TRUE(builder->Absorb(Delta(8, 3, points.leftCols(1), {}, {}, false)));
  builder->Reset();
  EXPECT_EQ(builder->revision(), 0u);
  ASSERT_TRUE(builder->Absorb(Delta(2, 0, points.leftCols(2), {0, 1}, {})));
  const Mesh mesh = *builder->Take();
  EXPECT_EQ(mesh.points, points.leftCols(2));
  EXPECT_EQ(mesh.simplices.cols(), 1);
}

TEST(Addresses, TellThisMachineFromOthers) {
  for (const char* here :
       {"unix:/run/s", "localhost:1", "127.0.0.1:7717", "127.3.2.1:1", "[::1]:5"})
    EXPECT_TRUE(StaysOnThisMachine(here)) << here;
  for (const char* away : {"example.org:7717", "10.0.0.1:1", "127.example.org:1", "[fe80::1]:5"})
    EXPECT_FALSE(StaysOnThisMachine(away)) << away;
}

TEST(DeltaMesh, RefusesWhatMakesNoSense) {
  auto builder = DeltaMesh::Create(1, 2);
  ASSERT_TRUE(builder.has_value());
  EXPECT_FALSE(builder->Absorb(Delta(1, 5, Eigen::MatrixXd::Zero(2, 1), {}, {})));  // a gap
  v1::DeltaChunk wide = Delta(1, 0, Eigen::MatrixXd(2, 0), {0, 1}, {});
  wide.mutable_delta()->mutable_added()->set_shape(1, 3);
  EXPECT_FALSE(builder->Absorb(std::move(wide)));
  // Vertex 1 never came.
  EXPECT_FALSE(builder->Absorb(Delta(1, 0, Eigen::MatrixXd::Zero(2, 1), {0, 1}, {})));
  for (const std::vector<std::uint32_t>& absent :
       {std::vector{1u, 2u}, {0u, 2u}, {4000000000u, 1u}}) {
    auto other = DeltaMesh::Create(1, 2);
    ASSERT_TRUE(other->Absorb(Delta(1, 0, Eigen::MatrixXd::Zero(2, 3), {0, 1}, {})));
    EXPECT_FALSE(other->Absorb(Delta(2, 3, Eigen::MatrixXd(2, 0), {}, absent)));
  }
  EXPECT_FALSE(DeltaMesh::Create(0, 2).has_value());
  EXPECT_FALSE(DeltaMesh::Create(kMaxSimplexDimension + 1, 20).has_value());
}

}  // namespace
}  // namespace stellate::client
