#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "server/convert/arrays.h"
#include "server/convert/mesh.h"
#include "server/convert/oracle.h"
#include "server/convert/scale.h"
#include "server/convert/spec.h"
#include "tests/server/support/sphere.h"

namespace stellate::server {
namespace {

using core::StatusCode;

v1::Array Numbers(const std::vector<double>& values, std::initializer_list<std::size_t> shape) {
  v1::Array array;
  ToProto(values.data(), shape, &array);
  return array;
}

v1::MeshSpec GoodSpec() {
  v1::MeshSpec spec;
  ToProto(testing::SphereSpec(0.25), &spec);
  spec.clear_limits();
  return spec;
}

TEST(ConvertArrays, RoundTrip) {
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Random(6, 4);
  v1::Array array;
  ToProto(matrix.data(), {4, 3, 2}, &array);
  EXPECT_EQ(ShapeText(array.shape()), "[4, 3, 2]");
  EXPECT_TRUE(CheckArray(array, {4, 3, 2}, "a", StatusCode::kOracleShape).ok());
  EXPECT_EQ(MatrixFromProto(array, 6, 4), matrix);
}

TEST(ConvertArrays, RefuseWhatIsNotThere) {
  v1::Array array = Numbers({1, 2, 3, 4, 5, 6}, {2, 3});
  const auto code = [&array](std::initializer_list<std::uint64_t> shape) {
    return CheckArray(array, shape, "a", StatusCode::kOracleShape).code;
  };
  EXPECT_EQ(code({2, 3}), StatusCode::kOk);
  EXPECT_EQ(code({3, 2}), StatusCode::kOracleShape);
  EXPECT_EQ(code({6}), StatusCode::kOracleShape);
  array.mutable_data()->pop_back();
  EXPECT_EQ(code({2, 3}), StatusCode::kOracleShape);
  array.clear_shape();
  for (int i = 0; i < 100000; ++i) array.add_shape(4294967295u);
  const core::Status status = CheckArray(array, {2, 3}, "a", StatusCode::kOracleShape);
  EXPECT_EQ(status.code, StatusCode::kOracleShape);
  EXPECT_LT(status.message.size(), 1000u);
}

TEST(ConvertSpec, RoundTrip) {
  v1::MeshSpec spec = GoodSpec();
  spec.mutable_criteria()->set_sliver_bound(0.1);
  spec.mutable_criteria()->set_candidates(5);
  spec.mutable_criteria()->set_advance_step(1.5);
  spec.mutable_criteria()->set_size_rate(0.3);
  spec.mutable_criteria()->set_max_deviation(0.01);
  spec.mutable_limits()->set_max_batch_queries(4000);
  spec.set_random_seed(42);
  spec.set_label("a sphere");
  spec.set_components(3);
  spec.set_audit(v1::AUDIT_THOROUGH);
  spec.mutable_limits()->set_max_vertices(5000);
  spec.mutable_limits()->set_answer_seconds(3);
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->label, "a sphere");
  EXPECT_EQ(request->timeouts.answer_limit, std::chrono::seconds(3));
  EXPECT_EQ(std::chrono::duration<double>(request->timeouts.worker_wait).count(),
            Config{}.worker_wait_seconds);
  EXPECT_EQ(request->spec.limits.max_rounds, Config{}.max_rounds);
  v1::MeshSpec back;
  ToProto(request->spec, &back);
  EXPECT_EQ(back.epsilon(), 0.25);
  EXPECT_EQ(back.random_seed(), 42u);
  EXPECT_EQ(back.components(), 3u);
  EXPECT_EQ(back.audit(), v1::AUDIT_THOROUGH);
  EXPECT_EQ(back.criteria().SerializeAsString(), spec.criteria().SerializeAsString());
  EXPECT_EQ(back.bounding_box().SerializeAsString(), spec.bounding_box().SerializeAsString());
  EXPECT_EQ(back.limits().max_vertices(), 5000u);
  EXPECT_EQ(back.limits().max_batch_queries(), 4000u);
}

TEST(ConvertSpec, ProtectionComesAndGoes) {
  v1::MeshSpec spec = GoodSpec(), back;
  spec.mutable_criteria()->set_protection(0.1);
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->spec.criteria.protection, 0.1);
  ToProto(request->spec, &back);
  EXPECT_EQ(back.criteria().protection(), 0.1);
  const auto without = FromProto(GoodSpec(), Config{});
  ASSERT_TRUE(without);
  v1::MeshSpec plain;
  ToProto(without->spec, &plain);
  EXPECT_FALSE(plain.criteria().has_protection());
}

TEST(ConvertSpec, LabelsAreBytesOfSignVectors) {
  v1::MeshSpec spec = GoodSpec();
  spec.set_walls(2);
  spec.mutable_oracle()->set_tangent_basis(true);
  spec.mutable_oracle()->set_conormals(true);
  spec.set_labels(std::string("\0\1\2\x7f", 4));
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->spec.labels, (std::vector<std::int8_t>{0, 1, 2, 127}));
  v1::MeshSpec back;
  ToProto(request->spec, &back);
  EXPECT_EQ(back.labels(), spec.labels());
  spec.set_labels(std::string("\0\x80\0\0", 4));
  const auto refused = FromProto(spec, Config{});
  ASSERT_FALSE(refused);
  EXPECT_TRUE(refused.error().message.starts_with("labels[1] is -128"));
}

TEST(ConvertSpec, NamesOfRegionsAreForPeople) {
  v1::MeshSpec spec = GoodSpec();
  spec.add_region_names("matrix");
  spec.add_region_names("");
  spec.add_region_names("Körner");
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->region_names, (std::vector<std::string>{"matrix", "", "Körner"}));
  const auto refused_for = [&](const std::string& name) {
    v1::MeshSpec wrong = spec;
    wrong.add_region_names(name);
    const auto refused = FromProto(wrong, Config{});
    return refused ? std::string("taken") : refused.error().message;
  };
  EXPECT_TRUE(refused_for("two\nlines").starts_with("region_names[3] has control characters"));
  EXPECT_TRUE(refused_for(std::string(129, 'x')).starts_with("region_names[3] has 129 bytes"));
  for (int i = 0; i < 125; ++i) spec.add_region_names("x");
  EXPECT_TRUE(refused_for("y").starts_with("region_names has 129 names but may have 127"));
}

TEST(ConvertSpec, AScaleHasALengthForEachAxis) {
  v1::MeshSpec spec = GoodSpec();
  for (const double unit : {.01, 500., 1.}) spec.add_scale(unit);
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->scale, Eigen::Vector3d(.01, 500, 1));
  EXPECT_EQ(FromProto(GoodSpec(), Config{})->scale.size(), 0);
  spec.set_scale(2, 0);
  EXPECT_TRUE(FromProto(spec, Config{}).error().message.starts_with("scale has 0 but"));
  spec.set_scale(2, std::numeric_limits<double>::infinity());
  EXPECT_TRUE(FromProto(spec, Config{}).error().message.starts_with("scale has inf but"));
  spec.add_scale(1);
  EXPECT_TRUE(FromProto(spec, Config{}).error().message.starts_with("scale has 4 numbers but"));
}

TEST(ConvertScale, DeliversPointsAndPlacesInTheirOwnCoordinates) {
  const Eigen::Vector3d scale(.01, 500, 1);
  std::vector<double> points{1, 2, 3, 4, 5, 6};
  ToOwnCoordinates(scale, &points);
  EXPECT_EQ(points, (std::vector<double>{.01, 1000, 3, .04, 2500, 6}));
  const std::string words =
      "refused at (1, -2e-05, 3.5): simplex (1 2 3) of (1, 2), (1, 2, 3, ...) and (1, 2, 3";
  EXPECT_EQ(
      InOwnCoordinates(scale, words),
      "refused at (0.01, -0.01, 3.5): simplex (1 2 3) of (1, 2), (1, 2, 3, ...) and (1, 2, 3");
  EXPECT_EQ(InOwnCoordinates({}, words), words);
  // Of many coordinates the first are written.
  const Eigen::VectorXd many = Eigen::VectorXd::Constant(9, 2);
  EXPECT_EQ(InOwnCoordinates(many, "at (1, 2, 3, 4, 5, 6, ...) or (1, 2, 3, 4, 5, 6)"),
            "at (2, 4, 6, 8, 10, 12, ...) or (1, 2, 3, 4, 5, 6)");
  v1::Certificate certificate;
  certificate.set_verdict("at (1, 1, 1)");
  certificate.add_warnings("near (0, 1, 0)");
  for (int i = 0; i < 3; ++i) certificate.mutable_sharpest()->add_point(1);
  ToOwnCoordinates(scale, &certificate);
  EXPECT_EQ(certificate.verdict(), "at (0.01, 500, 1)");
  EXPECT_EQ(certificate.warnings(0), "near (0, 500, 0)");
  EXPECT_EQ(certificate.sharpest().point(1), 500);
}

TEST(ConvertSpec, SeedsBecomeColumns) {
  v1::MeshSpec spec = GoodSpec();
  *spec.mutable_seeds() = Numbers({1, 0, 0, 0, 1, 0}, {2, 3});
  const auto request = FromProto(spec, Config{});
  ASSERT_TRUE(request);
  EXPECT_EQ(request->spec.seeds.cols(), 2);
  EXPECT_EQ(request->spec.seeds(1, 1), 1);
}

TEST(ConvertSpec, RefusalsStartWithTheField) {
  const auto expect = [](const char* field, StatusCode code, auto change) {
    v1::MeshSpec spec = GoodSpec();
    change(&spec);
    const auto request = FromProto(spec, Config{});
    ASSERT_FALSE(request) << field;
    EXPECT_EQ(request.error().code, code) << request.error().message;
    EXPECT_TRUE(request.error().message.starts_with(field)) << request.error().message;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  using Spec = v1::MeshSpec;
  expect("dimension", StatusCode::kInvalidArgument, [](Spec* s) { s->set_dimension(0); });
  expect("dimension", StatusCode::kLimitExceeded, [](Spec* s) { s->set_dimension(4294967295u); });
  expect("ambient_dimension", StatusCode::kLimitExceeded,
         [](Spec* s) { s->set_ambient_dimension(4294967295u); });
  expect("ambient_dimension", StatusCode::kInvalidArgument, [](Spec* s) {
    s->set_ambient_dimension(0);  // and a box that has coordinates
  });
  expect("walls is 4294967295", StatusCode::kLimitExceeded,
         [](Spec* s) { s->set_walls(4294967295u); });
  expect("bounding_box.lower", StatusCode::kInvalidArgument, [](Spec* s) {
    *s->mutable_bounding_box()->mutable_lower() = Numbers({0, 0}, {2});
  });
  expect("bounding_box.upper", StatusCode::kInvalidArgument,
         [](Spec* s) { s->mutable_bounding_box()->mutable_upper()->mutable_data()->clear(); });
  expect("seeds", StatusCode::kInvalidArgument, [](Spec* s) {
    *s->mutable_seeds() = Numbers({1, 2, 3, 4}, {2, 2});
  });
  expect("seeds", StatusCode::kInvalidArgument, [](Spec* s) {
    s->mutable_seeds()->add_shape(4294967295u);  // 103 GB, declared only
    s->mutable_seeds()->add_shape(3);
  });
  expect("seeds", StatusCode::kInvalidArgument, [nan](Spec* s) {
    *s->mutable_seeds() = Numbers({1, nan, 3}, {1, 3});
  });
  expect("criteria.advance_step", StatusCode::kInvalidArgument,
         [](Spec* s) { s->mutable_criteria()->set_advance_step(0.1); });
  expect("criteria.candidates", StatusCode::kLimitExceeded,
         [](Spec* s) { s->mutable_criteria()->set_candidates(4294967295u); });
  expect("limits.max_vertices", StatusCode::kLimitExceeded,
         [](Spec* s) { s->mutable_limits()->set_max_vertices(1ull << 40); });
  expect("limits.max_rounds", StatusCode::kLimitExceeded,
         [](Spec* s) { s->mutable_limits()->set_max_rounds(1ull << 40); });
  expect("limits.worker_wait_seconds", StatusCode::kInvalidArgument,
         [nan](Spec* s) { s->mutable_limits()->set_worker_wait_seconds(nan); });
  expect("limits.answer_seconds", StatusCode::kInvalidArgument,
         [](Spec* s) { s->mutable_limits()->set_answer_seconds(-1); });
  expect("limits.answer_seconds", StatusCode::kLimitExceeded,
         [](Spec* s) { s->mutable_limits()->set_answer_seconds(1e9); });
  expect("audit", StatusCode::kInvalidArgument,
         [](Spec* s) { s->set_audit(static_cast<v1::Audit>(7)); });
  expect("components", StatusCode::kInvalidArgument, [](Spec* s) { s->set_components(2'000'000); });
  expect("label", StatusCode::kInvalidArgument,
         [](Spec* s) { s->set_label(std::string(129, 'x')); });
  std::string many;
  for (int i = 0; i < 301; ++i) many += "\xc3\xa9";
  for (const std::string& words : {many, std::string("a\nb"), std::string("\x1b[2J"),
                                   std::string("\xe2\x80\xae"), std::string("\xff")}) {
    expect("oracle.about", StatusCode::kInvalidArgument,
           [&words](Spec* s) { s->mutable_oracle()->set_about(words); });
  }
}

TEST(ConvertSpec, VerticesAreBoundedByTheirCoordinatesToo) {
  Config config;
  config.max_coordinates = 3000;
  const auto request = FromProto(GoodSpec(), config);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->spec.limits.max_vertices, 1000u);
}

class ConvertOracleTest : public ::testing::Test {
 protected:
  ConvertOracleTest() {
    core::QueryBlock block;
    block.kind = core::QueryKind::kIntersectFlat;
    block.points = Eigen::MatrixXd::Random(3, 5);
    block.bases = Eigen::MatrixXd::Random(6, 5);
    block.radii = Eigen::VectorXd::Random(5);
    block.want.tangents = block.want.sizes = true;
    chunk_.round = std::make_shared<Round>();
    batch_->blocks = {block};
    chunk_.round->batch = batch_;
    chunk_.lease = 9;
    chunk_.first = 1;
    chunk_.count = 2;
    good_.set_lease(9);
    *good_.mutable_points() = Numbers({1, 2, 3, 4, 5, 6}, {2, 3});
    *good_.mutable_tangents() = Numbers(std::vector<double>(12, 0.5), {2, 3, 2});
    *good_.mutable_sizes() = Numbers({0.25, 0.5}, {2});
    good_.set_found(std::string("\1\0", 2));
  }

  const core::Specification spec_ = testing::SphereSpec(0.1);
  const std::shared_ptr<core::QueryBatch> batch_ = std::make_shared<core::QueryBatch>();
  Chunk chunk_;
  v1::AnswerChunk good_;
};

TEST_F(ConvertOracleTest, AChunkCarriesItsColumns) {
  v1::QueryChunk out;
  ToProto(chunk_, spec_, &out);
  const core::QueryBlock& block = chunk_.block();
  EXPECT_EQ(out.lease(), 9u);
  EXPECT_EQ(out.kind(), v1::QUERY_KIND_INTERSECT_FLAT);
  EXPECT_TRUE(out.want_tangents());
  EXPECT_TRUE(out.want_sizes());
  EXPECT_EQ(ShapeText(out.bases().shape()), "[2, 3, 2]");
  EXPECT_EQ(MatrixFromProto(out.points(), 3, 2), block.points.middleCols(1, 2));
  EXPECT_EQ(MatrixFromProto(out.bases(), 6, 2), block.bases.middleCols(1, 2));
  EXPECT_EQ(MatrixFromProto(out.radii(), 1, 2), block.radii.segment(1, 2).transpose());
  batch_->blocks[0].kind = core::QueryKind::kClosestPoint;
  v1::QueryChunk closest;
  ToProto(chunk_, spec_, &closest);
  EXPECT_FALSE(closest.has_bases());
  EXPECT_FALSE(closest.has_radii());
}

TEST_F(ConvertOracleTest, AnswersAreReadColumnByColumn) {
  const auto answer = FromProto(good_, chunk_, spec_);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->points(2, 1), 6);
  EXPECT_EQ(answer->found, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(answer->tangents.cols(), 2);
  EXPECT_EQ(answer->sizes, Eigen::Vector2d(0.25, 0.5));
}

TEST_F(ConvertOracleTest, SizesThatWereNotAskedForAreIgnored) {
  batch_->blocks[0].want.sizes = false;
  good_.mutable_sizes()->add_shape(9);
  const auto answer = FromProto(good_, chunk_, spec_);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->sizes.size(), 0);
}

TEST_F(ConvertOracleTest, TangentsThatWereNotAskedForAreIgnored) {
  batch_->blocks[0].want.tangents = false;
  const auto answer = FromProto(good_, chunk_, spec_);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->tangents.size(), 0);
}

TEST_F(ConvertOracleTest, MalformedAnswersAreRefused) {
  const auto expect_refused = [this](const char* what, auto change) {
    v1::AnswerChunk bad = good_;
    change(&bad);
    const auto answer = FromProto(bad, chunk_, spec_);
    ASSERT_FALSE(answer) << what;
    EXPECT_EQ(answer.error().code, StatusCode::kOracleShape) << what;
  };
  using Answers = v1::AnswerChunk;
  expect_refused("no points", [](Answers* a) { a->clear_points(); });
  expect_refused("one point too few", [](Answers* a) {
    *a->mutable_points() = Numbers({1, 2, 3}, {1, 3});
  });
  expect_refused("points of another space", [](Answers* a) {
    *a->mutable_points() = Numbers({1, 2, 3, 4}, {2, 2});
  });
  expect_refused("bytes missing",
                 [](Answers* a) { a->mutable_points()->mutable_data()->pop_back(); });
  expect_refused("a shape of another rank", [](Answers* a) { a->mutable_points()->add_shape(1); });
  expect_refused("found too long", [](Answers* a) { a->set_found(std::string(3, '\1')); });
  expect_refused("found neither 0 nor 1", [](Answers* a) { a->set_found("\1\2"); });
  expect_refused("tangents flat", [](Answers* a) {
    *a->mutable_tangents() = Numbers(std::vector<double>(12), {2, 6});
  });
  expect_refused("sizes too few", [](Answers* a) { *a->mutable_sizes() = Numbers({1}, {1}); });
  expect_refused("sizes in a column", [](Answers* a) {
    *a->mutable_sizes() = Numbers({1, 2}, {2, 1});
  });
  expect_refused("sizes' bytes missing",
                 [](Answers* a) { a->mutable_sizes()->mutable_data()->pop_back(); });
  expect_refused("tangents declared only", [](Answers* a) { a->mutable_tangents()->clear_data(); });
}

TEST(ConvertMesh, EachStateAndTerminationHasItsName) {
  for (const auto state :
       {SessionState::kWaiting, SessionState::kRunning, SessionState::kSucceeded,
        SessionState::kStopped, SessionState::kCancelled, SessionState::kFailed}) {
    EXPECT_EQ(v1::MeshState_Name(ToProto(state)),
              std::string("MESH_STATE_") + SessionStateName(state));
  }
  using core::Termination;
  for (const auto t :
       {Termination::kConverged, Termination::kVertexBudget, Termination::kRoundBudget,
        Termination::kCancelled, Termination::kOracleFailed, Termination::kNoProgress}) {
    EXPECT_EQ(v1::Termination_Name(ToProto(t)),
              std::string("TERMINATION_") + core::TerminationName(t));
  }
  using core::Phase;
  for (const auto p : {Phase::kSeeding, Phase::kRefining, Phase::kCertifying, Phase::kDone}) {
    EXPECT_EQ(v1::Phase_Name(ToProto(p)), std::string("PHASE_") + core::PhaseName(p));
  }
}

TEST(ConvertMesh, DeltasKeepTheirRows) {
  DeltaPart part;
  part.revision = 4;
  part.first_vertex = 7;
  part.points = {1, 2, 3};
  part.added = {0, 1, 7};
  part.complete = true;
  v1::DeltaChunk out;
  ToProto(part, 2, 3, &out);
  EXPECT_TRUE(out.complete());
  EXPECT_EQ(out.delta().points().shape(0), 1u);
  EXPECT_EQ(out.delta().added().shape(1), 3u);
  EXPECT_EQ(out.delta().removed().shape(0), 0u);
  std::uint32_t last = 0;
  std::memcpy(&last, out.delta().added().data().data() + 8, 4);
  EXPECT_EQ(last, 7u);
}

TEST(ConvertReport, TellsOfRegionsAndOfTheSidesOfTheirWalls) {
  core::Report report;
  report.certificate.regions = {{2, 30, 1, 1, 0.25, 12, {1, 0, 0, 0}}, {5, 40, 2, -1, 0.5, 9, {}}};
  report.certificate.pinched_vertices = 3;
  report.certificate.faces = {{core::WallSet{3}, 1, 7, 2, 0, {0, 1}, 4, {2, 2}},
                              {core::WallSet{1}, 2, 9, 1, 1, {5, 2}, 1.5, {1, 0, 0}}};
  report.certificate.volume = 0.75;
  v1::Report sent;
  ToProto(report, 3, &sent);
  const v1::Certificate& certificate = sent.certificate();
  ASSERT_EQ(certificate.regions_size(), 2);
  EXPECT_EQ(certificate.regions(1).label(), 5u);
  EXPECT_EQ(certificate.regions(1).simplices(), 40u);
  EXPECT_EQ(certificate.regions(1).components(), 2u);
  EXPECT_EQ(certificate.regions(1).euler_characteristic(), -1);
  EXPECT_EQ(certificate.regions(1).volume(), 0.5);
  EXPECT_EQ(certificate.regions(1).min_dihedral_degrees(), 9);
  EXPECT_EQ(certificate.pinched_vertices(), 3u);
  EXPECT_EQ(certificate.regions(0).betti_size(), 4);
  EXPECT_EQ(certificate.regions(1).betti_size(), 0);
  EXPECT_EQ(certificate.faces(1).volume(), 1.5);
  EXPECT_EQ(certificate.faces(0).betti(1), 2);
  EXPECT_EQ(certificate.volume(), 0.75);
  EXPECT_FALSE(certificate.faces(0).has_label_below()) << "an edge has more than two sides";
  EXPECT_EQ(certificate.faces(1).label_below(), 5u);
  EXPECT_EQ(certificate.faces(1).label_above(), 2u);
}

TEST(ConvertReport, TellsOfFacesAndWhereWallsMeetMostSharply) {
  core::Report report;
  report.certificate.boundary_simplices = 12;
  report.certificate.boundary_components = 2;
  report.certificate.boundary_euler_characteristic = -4;
  report.certificate.faces = {{core::WallSet{5}, 1, 7, 2, -3, {0, 1}, 0, {}}};
  v1::Report sent;
  ToProto(report, 3, &sent);
  EXPECT_FALSE(sent.certificate().has_sharpest());
  EXPECT_FALSE(sent.certificate().only_too_coarse());
  report.certificate.only_too_coarse = true;
  report.certificate.sharpest = core::WallAngle{core::WallSet{3}, 27.5, Eigen::Vector2d(0.5, -0.5)};
  ToProto(report, 3, &sent);
  const v1::Certificate& certificate = sent.certificate();
  EXPECT_EQ(certificate.boundary_simplices(), 12u);
  EXPECT_EQ(certificate.boundary_components(), 2u);
  EXPECT_EQ(certificate.boundary_euler_characteristic(), -4);
  const v1::FaceCertificate& face = certificate.faces(0);
  EXPECT_EQ(std::vector<std::uint32_t>(face.walls().begin(), face.walls().end()),
            (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(face.dimension(), 1u);
  EXPECT_EQ(face.simplices(), 7u);
  EXPECT_EQ(face.components(), 2u);
  EXPECT_EQ(face.euler_characteristic(), -3);
  EXPECT_EQ(certificate.sharpest().walls_size(), 2);
  EXPECT_EQ(certificate.sharpest().degrees(), 27.5);
  EXPECT_EQ(certificate.sharpest().point(1), -0.5);
  EXPECT_TRUE(certificate.only_too_coarse());
}

}  // namespace
}  // namespace stellate::server
