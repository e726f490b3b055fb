// The examples in comments of public headers, as they stand there: tests/words/examples_test.py
// compares them. What needs a server or a file is compiled and not run.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>
#include <utility>

#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/connection.h"
#include "stellate/download.h"
#include "stellate/error.h"
#include "stellate/implicit.h"
#include "stellate/mesh.h"
#include "stellate/monitor.h"
#include "stellate/oracle.h"
#include "stellate/oracles/combined.h"
#include "stellate/oracles/equations.h"
#include "stellate/oracles/parametrized.h"
#include "stellate/oracles/points.h"
#include "stellate/oracles/walls.h"
#include "stellate/pointwise.h"
#include "stellate/serve.h"

namespace header_examples {

namespace of_oracle {
struct Circle : stellate::Oracle {
  int dimension() const override { return 1; }
  int ambient_dimension() const override { return 2; }
  stellate::Answer ClosestPoint(const Eigen::MatrixXd& x) override {
    return {x.colwise().normalized()};
  }
  Eigen::MatrixXd seeds() const override { return Eigen::Vector2d(1, 0); }
};
}  // namespace of_oracle

struct Circle : stellate::PointwiseOracle {
  Circle() : PointwiseOracle(1, 2) {}
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    y = x.normalized();
    return x.norm() > 0;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    tangent = Eigen::Vector2d(-y[1], y[0]);
  }
  Eigen::MatrixXd seeds() const override { return Eigen::Vector2d(1, 0); }
};

[[maybe_unused]] void MeshIt(stellate::Oracle& oracle) {
  const auto Use = [](const stellate::Mesh& mesh) { std::cerr << mesh.points.cols(); };
  stellate::MeshOptions options;
  options.epsilon = 0.1;
  const auto mesh = stellate::MeshManifold(oracle, options);
  if (!mesh)
    std::cerr << mesh.error().message;
  else if (mesh->report.certified())
    Use(*mesh);
}

[[maybe_unused]] void AskAServer(stellate::Oracle& oracle) {
  stellate::MeshOptions options;
  options.epsilon = 0.1;
  options.epsilon = stellate::kAuto;
  options.connection.server = "mesher.example.org:7717";
  options.connection.credentials.tls = true;
  const stellate::Expected<stellate::Mesh> mesh = stellate::MeshManifold(oracle, options);
  if (!mesh) std::cerr << mesh.error().message << '\n';
  stellate::ServeOptions serving;
  serving.connection = options.connection;
  const auto name = stellate::DeclareMesh(oracle, options);
  if (name) const auto ended = stellate::ServeMesh(oracle, *name, serving);
  stellate::DownloadOptions downloading;
  downloading.connection.server = "mesher.example.org:7717";
  downloading.unfinished = stellate::Unfinished::kWait;
  const auto downloaded = stellate::DownloadMesh("meshes/1b9d6bcd", downloading);
}

[[maybe_unused]] void MeshInUnits(const std::shared_ptr<stellate::Oracle>& oracle,
                                  const stellate::MeshOptions& options) {
  stellate::oracles::InUnits states(oracle, Eigen::Vector3d(0.01, 500, 1));
  const auto mesh = stellate::MeshManifold(states, options);  // mesh->points as of `oracle`
}

[[maybe_unused]] void ListMeshes(const stellate::Connection& connection) {
  auto monitor = stellate::Monitor::Connect(connection);
  if (!monitor) return;
  if (const auto meshes = monitor->Meshes())
    for (const stellate::MeshStatus& mesh : *meshes)
      std::cerr << mesh.name << ": " << stellate::MeshStateName(mesh.state) << '\n';
}

template <typename DrawTriangle>
void Show(const stellate::Mesh& mesh, const DrawTriangle& Draw) {
  for (const auto& ids : stellate::OrientedSimplices(mesh).colwise())
    Draw(mesh.points.col(ids[0]), mesh.points.col(ids[1]), mesh.points.col(ids[2]));
  const stellate::Expected<void> saved = mesh.Save("surface.vtu");
}

[[maybe_unused]] void ReadAFile() {
  stellate::oracles::PointCloud cloud(stellate::oracles::ReadPoints("scan.ply"), 2);
  std::cerr << cloud.about() << '\n';  // with the bandwidth
  Show({}, [](const auto& a, const auto&, const auto&) { std::cerr << a; });
}

TEST(HeaderExamples, OfOracles) {
  EXPECT_EQ(of_oracle::Circle().ClosestPoint(Eigen::Vector2d(2, 0)).points, Eigen::Vector2d(1, 0));
  EXPECT_EQ(Circle().ClosestPoint(Eigen::Vector2d(2, 0)).points, Eigen::Vector2d(1, 0));

  const auto f = [](const Eigen::VectorXd& x) {
    return Eigen::VectorXd::Constant(1, x.squaredNorm() - 1);
  };
  const stellate::BoundingBox box = {Eigen::Vector3d::Constant(-2), Eigen::Vector3d::Constant(2)};
  stellate::ImplicitOracle sphere(2, 3, f, {}, box);
  EXPECT_NEAR(sphere.ClosestPoint(Eigen::Vector3d(0, 0, 3)).points(2), 1, 1e-9);

  const auto torus = stellate::MakeManifold("torus:1:0.4");
  if (torus) std::cerr << (*torus)->facts().description << '\n';
  EXPECT_TRUE(torus.has_value());
}

TEST(HeaderExamples, OfReadyOracles) {
  stellate::oracles::Chart chart;  // a circle
  chart.x = [](const auto& u) { return Eigen::Vector2d(std::cos(u[0]), std::sin(u[0])); };
  chart.lower = Eigen::VectorXd::Zero(1);
  chart.upper = Eigen::VectorXd::Constant(1, 2 * std::numbers::pi);
  chart.periodic = {true};
  const auto circle = std::make_shared<stellate::oracles::Parametrized>(chart);
  EXPECT_NEAR(circle->ClosestPoint(Eigen::Vector2d(0, 3)).points(1), 1, 1e-9);

  stellate::oracles::Product flat_torus({circle, circle});  // in R^4
  EXPECT_EQ(flat_torus.ambient_dimension(), 4);

  const stellate::oracles::Wall upper = stellate::oracles::HalfSpace(Eigen::Vector2d::UnitY());
  stellate::oracles::Clipped arc(circle, {upper});
  EXPECT_EQ(arc.walls(), 1);

  const stellate::oracles::Linkage::Places fixed = {{"base", Eigen::Vector2d(0, 0)}};
  stellate::oracles::Linkage arm({{"base", "elbow", 1}, {"elbow", "hand", 1}}, fixed);  // k = 2
  EXPECT_EQ(arm.dimension(), 2);
}

}  // namespace header_examples
