// Meshes a torus in this process: the core asks, this program answers. No server, no gRPC.
//
//   mesh_in_process > torus.off
#include <Eigen/Core>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "stellate/core/mesher.h"

namespace core = stellate::core;

// The point nearest to x of the torus of radii 1 and 0.4 around the z axis.
Eigen::Vector3d ClosestPoint(const Eigen::Vector3d& x) {
  const double r = std::hypot(x(0), x(1));
  const Eigen::Vector3d circle = r > 0 ? Eigen::Vector3d(x(0) / r, x(1) / r, 0)  // its core's
                                       : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d away = x - circle;
  if (away.norm() == 0) return 1.4 * circle;
  return circle + 0.4 * away.normalized();
}

// Every block holds queries of one kind. This oracle has promised neither flats nor tangents, so
// all of them ask for closest points. They are independent: take all your cores, a batch is large.
core::Answers Answer(const core::QueryBatch& batch) {
  core::Answers answers;
  for (const core::QueryBlock& block : batch.blocks) {
    core::AnswerBlock answer;
    answer.points.resize(block.points.rows(), block.size());
    for (Eigen::Index j = 0; j < block.size(); ++j) {
      answer.points.col(j) = ClosestPoint(block.points.col(j));
    }
    answers.blocks.push_back(std::move(answer));
  }
  return answers;
}

int main() {
  core::Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = 0.15;
  spec.seeds = Eigen::Vector3d(1.4, 0, 0);

  const auto mesher = core::Mesher::Create(spec);
  if (!mesher) {
    std::cerr << mesher.error().message << "\n";
    return EXIT_FAILURE;
  }
  while (const auto batch = (*mesher)->NextBatch()) {
    // On success it is what has changed, to show a mesh that grows.
    const auto delta = (*mesher)->Absorb(Answer(*batch));
    if (!delta) (*mesher)->Fail(delta.error());  // an answer broke a rule: the run is over
  }

  const core::Report& report = (*mesher)->report();
  std::cerr << report.certificate.verdict << "\n";
  const Eigen::MatrixXd points = (*mesher)->Points();  // 3 x n
  const auto triangles = (*mesher)->Simplices();       // 3 vertices each, one after another
  std::cout << "OFF\n"
            << points.cols() << " " << triangles.size() / 3 << " 0\n"
            << points.transpose() << "\n";
  for (std::size_t i = 0; i < triangles.size(); i += 3) {
    std::cout << "3 " << triangles[i] << " " << triangles[i + 1] << " " << triangles[i + 2] << "\n";
  }
  return report.certificate.certified ? EXIT_SUCCESS : EXIT_FAILURE;
}
