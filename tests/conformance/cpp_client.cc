// The C++ client under `stellate conform`, whose help says what each line wants.
#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "files.h"
#include "silent_oracle.h"
#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/monitor.h"
#include "stellate/reconstruct.h"
#include "stellate/serve.h"
#include "support/spoiled_oracle.h"

namespace stellate::testing {
namespace {

// The unit circle of the first two coordinates of R^d; the catalogue's is turned.
class Circle final : public Oracle {
 public:
  explicit Circle(int d) : d_(d) {}
  int dimension() const override { return 1; }
  int ambient_dimension() const override { return d_; }
  bool has_tangent_basis() const override { return true; }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override {
    Answer answer;
    answer.points.setZero(d_, x.cols());
    answer.points.topRows<2>() = x.topRows<2>().colwise().normalized();
    return answer;
  }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    Eigen::MatrixXd bases = Eigen::MatrixXd::Zero(d_, points.cols());
    bases.row(0) = -points.row(1);
    bases.row(1) = points.row(0);
    return bases;
  }

 private:
  const int d_;
};

// The part of the unit sphere where z >= 0 and y >= 0.
class Lune final : public Oracle {
 public:
  int dimension() const override { return 2; }
  int ambient_dimension() const override { return 3; }
  bool has_tangent_basis() const override { return true; }
  int walls() const override { return 2; }
  std::optional<BoundingBox> bounding_box() const override { return sphere_->bounding_box(); }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return sphere_->ClosestPoint(x); }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return sphere_->TangentBasis(points);
  }
  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override {
    Answer answer;
    answer.points = x;
    for (const int wall : face) answer.points.row(Axis(wall)).setZero();
    const Eigen::ArrayXd lengths = answer.points.colwise().norm().transpose();
    answer.points.colwise().normalize();
    for (const double length : lengths) answer.found.push_back(length > 0);
    return answer;
  }
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override {
    Eigen::MatrixXd values(2, points.cols());
    for (int wall = 0; wall < 2; ++wall) values.row(wall) = points.row(Axis(wall));
    return values;
  }
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override {
    const auto count = static_cast<Eigen::Index>(face.size());
    Eigen::MatrixXd normals = Eigen::MatrixXd::Zero(3 * count, points.cols());
    for (Eigen::Index i = 0; i < count; ++i) {
      normals.row(3 * i + Axis(face[static_cast<size_t>(i)])).setConstant(-1);
    }
    return normals;
  }

 private:
  static int Axis(int wall) { return wall == 0 ? 2 : 1; }

  const std::unique_ptr<Manifold> sphere_ = MakeManifold("sphere:2").value();
};

// A manifold of the catalogue, changed as the kit wants it.
struct Changed {
  explicit Changed(const std::string& name) : manifold(MakeManifold(name).value()) {
    if (manifold == nullptr) throw std::logic_error("the catalogue has no " + name);
    oracle = std::make_unique<SpoiledOracle>(*manifold);
    oracle->intersects = oracle->has_sizes = false;
  }
  std::unique_ptr<Manifold> manifold;
  std::unique_ptr<SpoiledOracle> oracle;
};

Changed Named(const std::string& name) {
  if (name == "clifford") return Changed("flat-torus:2");
  if (name == "so3") return Changed("so3");
  if (name == "sphere") {
    Changed sphere("sphere:2");
    sphere.oracle->intersects = sphere.oracle->has_sizes = true;
    sphere.oracle->on_sizes = [](const Eigen::MatrixXd& points, Eigen::VectorXd& sizes) {
      sizes = (1 + points.row(2).array() / 2).transpose();
    };
    return sphere;
  }
  Changed torus("torus:1:0.4");
  if (name == "half") {
    torus.oracle->on_closest = [](const Eigen::MatrixXd& x, Answer& answer) {
      answer.found.resize(static_cast<size_t>(x.cols()));
      for (Eigen::Index j = 0; j < x.cols(); ++j) {
        answer.found[static_cast<size_t>(j)] = x(0, j) >= 0;
      }
    };
  } else if (name == "raises") {
    torus.oracle->on_closest = [](const Eigen::MatrixXd&, Answer&) {
      throw std::runtime_error("on purpose");
    };
  } else if (name == "slow") {
    torus.oracle->on_closest = [](const Eigen::MatrixXd&, Answer&) {
      std::this_thread::sleep_for(std::chrono::seconds(2));
    };
  }
  return torus;
}

std::string Words(const Error& error) {
  const char* const faults[] = {"request", "oracle", "server", "file"};
  std::string words = error.message;
  for (char& c : words) c = c == '\n' ? ' ' : c;
  return std::string("error ") + faults[static_cast<int>(error.code)] + " " +
         (error.reason.empty() ? "-" : error.reason) + " " + words;
}

std::string Serve(Oracle& oracle, const std::string& mesh, const std::string& server) {
  ServeOptions options;
  options.connection.server = server;
  try {
    const auto state = ServeMesh(oracle, mesh, options);
    return state ? std::string("over ") + MeshStateName(*state) : Words(state.error());
  } catch (const std::runtime_error& error) {
    return std::string("error oracle RAISED ") + error.what();
  }
}

// Of the mesh that is declared, as this client watches no other.
std::string Watch(int k, int d, const std::string& path, const std::string& server) {
  Silent oracle(k, d);
  MeshOptions options;
  options.epsilon = 1;
  options.connection.server = server;
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  if (!mesh) return Words(mesh.error());
  if (const auto saved = mesh->Save(path); !saved) return Words(saved.error());
  if (!mesh->walls.empty()) {
    std::ofstream file(path + ".walls");
    for (const std::uint64_t bits : mesh->walls) file << bits << '\n';
  }
  return std::string("mesh - ") + TerminationName(mesh->report.termination) + " " +
         CertificateLevelName(mesh->report.certificate.level);
}

std::string Create(const std::string& label, const std::string& how, const std::string& server) {
  Changed torus("torus:1:0.4");
  MeshOptions options;
  options.epsilon = 0.5;
  options.connection.server = server;
  options.label = label;
  if (how == "seeds") {
    torus.oracle->box.reset();
    torus.oracle->given_seeds = Eigen::Vector3d(1.4, 0, 0);
  } else if (how.rfind("token=", 0) == 0) {
    options.connection.credentials.token = how.substr(6);
  }
  Lune lune;
  Oracle& oracle = how == "walls" ? static_cast<Oracle&>(lune) : *torus.oracle;
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  return mesh ? "created -" : Words(mesh.error());
}

// A file with lines of other lengths is no matrix, and is refused as it is read.
std::string FromPoints(const std::string& path, int k, int d, const std::string& server) {
  std::vector<double> numbers;
  std::ifstream file(path);
  for (double x = 0; file >> x;) numbers.push_back(x);
  const auto count = static_cast<Eigen::Index>(numbers.size());
  if (count % d != 0) return "error request INVALID_ARGUMENT no whole points";
  ReconstructOptions options;
  options.dimension = k;
  options.connection.server = server;
  const Expected<Mesh> mesh =
      Reconstruct(Eigen::Map<const Eigen::MatrixXd>(numbers.data(), d, count / d), options);
  if (!mesh) return Words(mesh.error());
  return std::string("mesh - ") + TerminationName(mesh->report.termination) + " " +
         CertificateLevelName(mesh->report.certificate.level);
}

std::string Save(const std::string& file, const std::string& path) {
  const auto saved = ReadTxt(file).Save(path);
  return saved ? "saved" : Words(saved.error());
}

std::string Obey(const std::string& line, const std::string& server) {
  std::istringstream words(line);
  std::string command;
  std::string first;
  std::string second;
  int k = 0;
  int d = 0;
  words >> command >> first >> second >> k >> d;
  if (command == "watch") return Watch(k, d, second, server);
  if (command == "create") return Create(first, second, server);
  if (command == "reconstruct") return FromPoints(first, std::stoi(second), k, server);
  if (command == "save") return Save(first, second);
  if (command != "serve") return "unsupported";
  if (second.rfind("circle:", 0) == 0) {
    Circle circle(std::stoi(second.substr(7)));
    return Serve(circle, first, server);
  }
  if (second == "lune") {
    Lune lune;
    return Serve(lune, first, server);
  }
  const Changed changed = Named(second);
  return Serve(*changed.oracle, first, server);
}

}  // namespace
}  // namespace stellate::testing

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::string line;
  while (std::getline(std::cin, line)) {
    std::cout << stellate::testing::Obey(line, argv[1]) << std::endl;
  }
}
