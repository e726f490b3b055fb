// The C++ client under `stellate conform`, whose help says what each line wants.
#include <chrono>
#include <functional>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "files.h"
#include "silent_oracle.h"
#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/monitor.h"
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

// A manifold of the catalogue, changed as the kit wants it.
struct Changed {
  explicit Changed(const std::string& name) : manifold(MakeManifold(name, nullptr)) {
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
  options.server = server;
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
  options.server = server;
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  if (!mesh) return Words(mesh.error());
  if (const auto saved = mesh->Save(path); !saved) return Words(saved.error());
  return std::string("mesh - ") + TerminationName(mesh->report.termination) + " " +
         CertificateLevelName(mesh->report.certificate.level);
}

std::string Create(const std::string& label, const std::string& how, const std::string& server) {
  Changed torus("torus:1:0.4");
  MeshOptions options;
  options.epsilon = 0.5;
  options.server = server;
  options.label = label;
  if (how == "seeds") {
    torus.oracle->box.reset();
    torus.oracle->given_seeds = Eigen::Vector3d(1.4, 0, 0);
  } else if (how.rfind("token=", 0) == 0) {
    options.credentials.token = how.substr(6);
  }
  const Expected<Mesh> mesh = MeshManifold(*torus.oracle, options);
  return mesh ? "created -" : Words(mesh.error());
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
  if (command == "save") return Save(first, second);
  if (command != "serve") return "unsupported";
  if (second.rfind("circle:", 0) == 0) {
    Circle circle(std::stoi(second.substr(7)));
    return Serve(circle, first, server);
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
