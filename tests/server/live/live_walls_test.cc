// Workers of a manifold with boundary that lie, or serve two of them, against a live server.

#include <atomic>
#include <cmath>
#include <limits>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::Vector3d;

constexpr double kEpsilon = 0.25;

// The part of the unit sphere with z >= height, and that turned inside out: z <= height, whose
// answers on the wall are the same but for the signs.
struct Cap {
  double height = 0;
  bool inside_out = false;

  Vector3d Closest(const Vector3d& x, bool on_wall) const {
    if (!on_wall) return x.normalized();
    const double along = std::hypot(x.x(), x.y()), radius = std::sqrt(1 - height * height);
    return {radius * x.x() / along, radius * x.y() / along, height};
  }
  double sign() const { return inside_out ? -1 : 1; }

  v1::AnswerChunk AnswerTo(const v1::QueryChunk& queries) const {
    const auto n = static_cast<Index>(queries.points().shape(0));
    const bool on_wall = queries.face_size() > 0;
    const MatrixXd points = MatrixFromProto(queries.points(), 3, n);
    MatrixXd closest(3, n), tangents(6, n), clearances(1, n), conormals(3, n);
    for (Index j = 0; j < n; ++j) {
      const Vector3d y = Closest(points.col(j), on_wall);
      closest.col(j) = y;
      const auto basis = SphereTangents(y);
      for (int i = 0; i < 3; ++i) tangents.col(j).segment(2 * i, 2) = basis.row(i).transpose();
      clearances(0, j) = on_wall ? 0 : sign() * (y.z() - height);
      conormals.col(j) = -sign() * (basis * basis.transpose() * Vector3d::UnitZ()).normalized();
    }
    v1::AnswerChunk out;
    out.set_lease(queries.lease());
    const auto count = static_cast<std::size_t>(n);
    ToProto(closest.data(), {count, 3}, out.mutable_points());
    if (queries.want_tangents()) ToProto(tangents.data(), {count, 3, 2}, out.mutable_tangents());
    if (queries.want_clearances()) ToProto(clearances.data(), {count, 1}, out.mutable_clearances());
    if (on_wall) ToProto(conormals.data(), {count, 1, 3}, out.mutable_conormals());
    return out;
  }
};

class LiveWallsTest : public LiveServer {
 protected:
  std::string CreateCap() {
    v1::MeshSpec spec = SpecOfSphere(kEpsilon);
    spec.set_walls(1);
    spec.mutable_oracle()->set_intersect_flat(false);
    spec.mutable_oracle()->set_conormals(true);
    v1::Mesh mesh;
    const grpc::Status status = Create(spec, &mesh);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  static RawWorker::Answer By(const Cap& cap) {
    return [cap](const v1::QueryChunk& queries) {
      v1::ServeOracleRequest request;
      *request.mutable_answers() = cap.AnswerTo(queries);
      return std::optional(request);
    };
  }

  // A mesh by two workers, both of whom are there when the first question is answered.
  v1::Mesh MeshBy(const Cap& first, const Cap& second) {
    const std::string name = CreateCap();
    const auto other = NewStub();
    std::atomic<bool> both_are_here{false};
    const auto by = [&both_are_here](const Cap& cap) -> RawWorker::Answer {
      return [&both_are_here, answer = By(cap)](const v1::QueryChunk& queries) {
        both_are_here.wait(false);
        return answer(queries);
      };
    };
    RawWorker a(stub_.get(), name, by(first));
    RawWorker b(other.get(), name, by(second));
    while (Get(name).workers() < 2) std::this_thread::yield();
    both_are_here = true;
    both_are_here.notify_all();
    return WatchToEnd(name);
  }
};

TEST_F(LiveWallsTest, WorkersThatAgreeMakeACertifiedMesh) {
  Start();
  const v1::Mesh mesh = MeshBy({0.1}, {0.1});
  EXPECT_EQ(mesh.state(), v1::MESH_STATE_SUCCEEDED) << mesh.report().ShortDebugString();
  EXPECT_TRUE(mesh.report().certificate().certified()) << mesh.report().ShortDebugString();
}

// Each offset is more than the answers to one question may be apart. All questions are asked twice:
// one to which both walls are equally near tells nothing, and which it is depends on who is quick.
// Where it tells nothing, a wall's own answers may contradict each other, and the refusal says
// whose they are.
TEST_F(LiveWallsTest, AWallAtTwoPlacesIsFound) {
  Config config;
  config.check_share = 1;
  Start(config);
  for (const double offset : {0.02, 0.05, 0.1, 0.2, 0.5}) {
    for (const double sign : {-1.0, 1.0}) {
      const v1::Mesh mesh = MeshBy({0.1}, {0.1 + sign * offset * kEpsilon});
      const std::string& message = mesh.report().failure().message();
      EXPECT_TRUE(mesh.report().failure().reason() == "WORKERS_DISAGREE" ||
                  message.find("they serve different manifolds") != std::string::npos)
          << sign * offset << " epsilon: " << mesh.report().ShortDebugString();
      EXPECT_NE(message.find("wall 0"), std::string::npos) << message;
    }
  }
}

TEST_F(LiveWallsTest, AWallWithTwoInsidesIsFound) {
  Start();
  for (const bool first : {false, true}) {
    const v1::Mesh mesh = MeshBy({0.1, first}, {0.1, !first});
    EXPECT_EQ(mesh.report().failure().reason(), "WORKERS_DISAGREE")
        << mesh.report().ShortDebugString();
    EXPECT_NE(mesh.report().failure().message().find("wall 0 there are"), std::string::npos)
        << mesh.report().failure().message();
  }
}

// It comes when the other has been compared with nobody, and has answered much.
TEST_F(LiveWallsTest, AWorkerThatComesLateIsComparedToo) {
  Start();
  const std::string name = CreateCap();
  std::atomic<int> chunks{0};
  std::atomic<bool> second_is_here{false};
  RawWorker first(stub_.get(), name, [&](const v1::QueryChunk& queries) {
    if (++chunks == 8)
      while (!second_is_here) std::this_thread::yield();
    return By({0.1})(queries);
  });
  while (chunks < 8) std::this_thread::yield();
  const auto other = NewStub();
  RawWorker second(other.get(), name, By({0.1 + 0.1 * kEpsilon}));
  while (Get(name).workers() < 2) std::this_thread::yield();
  second_is_here = true;
  EXPECT_EQ(WatchToEnd(name).report().failure().reason(), "WORKERS_DISAGREE");
}

// In a chunk that does not begin its round, so that the query's number is not its row.
TEST_F(LiveWallsTest, ABadAnswerIsNamedByItsLeaseAndRow) {
  Start();
  for (const bool on_wall : {false, true}) {
    std::string lease, query;
    RawWorker liar(stub_.get(), CreateCap(), [&](const v1::QueryChunk& queries) {
      auto request = By({0.1})(queries);
      if (!lease.empty() || queries.points().shape(0) <= 3 || (queries.face_size() > 0) != on_wall)
        return request;
      lease = std::to_string(queries.lease());
      Poke(request->mutable_answers()->mutable_points(), 3 * 3 + 1,
           std::numeric_limits<double>::quiet_NaN());
      return request;
    });
    const grpc::Status status = liar.Wait();
    ASSERT_EQ(ReasonIn(status), "ORACLE_NOT_FINITE") << status.error_message();
    EXPECT_EQ(MetadataIn(status, "lease"), lease);
    EXPECT_EQ(MetadataIn(status, "row"), "3");
    EXPECT_TRUE(status.error_message().ends_with(" (lease " + lease + ", row 3)"))
        << status.error_message();
  }
}

TEST_F(LiveWallsTest, ArraysOfWallsAreNamedByTheirLeaseAndField) {
  Start();
  for (const bool on_wall : {false, true}) {
    std::string lease;
    RawWorker liar(stub_.get(), CreateCap(), [&](const v1::QueryChunk& queries) {
      auto request = By({0.1})(queries);
      if (!lease.empty() || (queries.face_size() > 0) != on_wall) return request;
      lease = std::to_string(queries.lease());
      v1::AnswerChunk* const answers = request->mutable_answers();
      (on_wall ? answers->mutable_conormals() : answers->mutable_clearances())->add_shape(2);
      return request;
    });
    const grpc::Status status = liar.Wait();
    ASSERT_EQ(ReasonIn(status), "ORACLE_SHAPE") << status.error_message();
    EXPECT_EQ(MetadataIn(status, "lease"), lease);
    EXPECT_EQ(FieldIn(status), on_wall ? "answers.conormals" : "answers.clearances");
  }
}

}  // namespace
}  // namespace stellate::server::testing
