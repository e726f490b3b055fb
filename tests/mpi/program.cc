// A program that meshes in parts, for test_program.py. Each rank says a line.
//
//   mpirun -n 2 mpi_program WHAT FOLDER [MANIFOLD|SOLID]
//
// WHAT: mesh, each rank writes FOLDER/RANK.vtu; files, MeshInPartsTo writes FOLDER/to.vtu; scaled,
// as mesh, in units of 1, 1, .5; stop, progress, oracle: rank 1 asks for the end, throws in
// on_progress, has an oracle that throws; thread: MPI of one thread.
#include <mpi.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <exception>
#include <memory>
#include <stdexcept>
#include <stop_token>
#include <string>

#include "stellate/mpi.h"
#include "stellate/stellate.h"

namespace {

// A sphere, up to an exception.
class Sphere final : public stellate::PointwiseOracle {
 public:
  explicit Sphere(bool is_lost) : stellate::PointwiseOracle(2, 3), is_lost_(is_lost) {}

  Eigen::MatrixXd seeds() const override { return Eigen::Vector3d(1, 0, 0); }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (is_lost_) throw std::runtime_error("the sphere is lost");
    y = x.normalized();
    return true;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    const Eigen::Vector3d normal = y, u = normal.unitOrthogonal();
    tangent.resize(3, 2);
    tangent.col(0) = u;
    tangent.col(1) = normal.cross(u);
  }

 private:
  bool is_lost_;
};

std::unique_ptr<stellate::Oracle> Named(const std::string& name) {
  if (name.find("(") == std::string::npos) return stellate::MakeManifold(name).value();
  return std::make_unique<stellate::solids::Solid>(stellate::solids::ParseSolid(name).value());
}

std::string Verdict(const stellate::Report& report) {
  return std::to_string(report.counts.vertices) +
         (report.certified() ? " vertices, certified" : " vertices, not certified");
}

std::string MeshIt(const std::string& what, const std::string& folder, const std::string& manifold,
                   int rank) {
  stellate::MeshOptions options;
  options.epsilon = 0.2;
  if (what == "scaled") options.scale = {1, 1, 0.5};
  std::stop_source stop;
  if (rank == 1 && what == "stop") options.stop = stop.get_token();
  if (rank == 1 && (what == "stop" || what == "progress"))
    options.on_progress = [&](const stellate::Progress& progress) {
      if (progress.round < 3) return;
      if (what == "progress") throw std::runtime_error("seen enough");
      stop.request_stop();
    };
  const std::unique_ptr<stellate::Oracle> oracle =
      manifold.empty() ? std::make_unique<Sphere>(what == "oracle" && rank == 1) : Named(manifold);
  if (what == "files") {
    const auto saved =
        stellate::MeshInPartsTo(*oracle, {folder + "/to.vtu"}, options, MPI_COMM_WORLD);
    return saved ? Verdict(saved->report) : saved.error().message;
  }
  const auto mesh = stellate::MeshInParts(*oracle, options, MPI_COMM_WORLD);
  if (!mesh) return mesh.error().message;
  if (auto ok = mesh->Save(folder + "/" + std::to_string(rank) + ".vtu"); !ok)
    return ok.error().message;
  return Verdict(mesh->report);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const std::string what = argv[1];
  const int level = what == "thread" ? MPI_THREAD_SINGLE : MPI_THREAD_SERIALIZED;
  int provided = 0, rank = 0;
  MPI_Init_thread(&argc, &argv, level, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  std::string said;
  try {
    said = MeshIt(what, argv[2], argc > 3 ? argv[3] : "", rank);
  } catch (const std::exception& thrown) {
    said = std::string("thrown: ") + thrown.what();
  }
  std::printf("rank %d: %s\n", rank, said.c_str());
  MPI_Finalize();
  return 0;
}
