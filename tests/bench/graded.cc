// Graded meshes, of sizes given and estimated: vertices, rounds, queries, quality and time.
//
//   graded [SEEDS [CASE]...]     how many random seeds, 1; cases by name, all
//
// Rounds of the refinement and of the certificate are counted apart; the time is the mesher's own,
// one thread. Of several seeds means, and of angles and fatness the least.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>

#include "tests/support/run_mesher.h"

namespace stellate::testing {
namespace {

using Field = std::function<double(const Eigen::VectorXd&)>;

struct Case {
  const char* name;
  const char* manifold;
  double epsilon;
  double rate, deviation;  // 0: no such criterion
  bool given;              // sizes; else they are estimated
  Field field;             // sizes, in place of the manifold's own
};

// Grows by `slope` with the distance from a point of the manifold.
Field Spot(const Eigen::VectorXd& at, double least, double slope) {
  return [=](const Eigen::VectorXd& y) { return least + slope * (y - at).norm(); };
}

const Case kCases[] = {
    {"torus", "torus:1:0.9", 0.5, 0.05, 0, true, {}},
    {"torus-coarse", "torus:1:0.9", 0.5, 0.2, 0, true, {}},
    {"ellipsoid", "ellipsoid:1:1:10", 0.8, 0.1, 0, true, {}},
    {"thin", "ellipsoid:1:1:0.1", 0.1, 0.3, 0, true, {}},
    {"slow", "torus:1:0.4", 0.05, 1, 0, true,
     [](const Eigen::VectorXd& y) { return 0.02 + 0.01 * y[0]; }},
    {"spot", "sphere:2", 0.03, 1, 0, true, Spot(Eigen::Vector3d(0, 0, 1), 0.001, 0.3)},
    {"steep", "sphere:2", 0.03, 1, 0, true, Spot(Eigen::Vector3d(0, 0, 1), 0.001, 1)},
    {"jump", "sphere:2", 0.05, 1, 0, true,
     [](const Eigen::VectorXd& y) { return y[2] > 0.9 ? 0.005 : 0.05; }},
    {"wavy", "sphere:2", 0.05, 1, 0, true,
     [](const Eigen::VectorXd& y) {
       return 0.03 + 0.02 * std::sin(60 * y[0]) * std::sin(60 * y[1]);
     }},
    {"rough", "sphere:2", 0.05, 1, 0, true,
     [](const Eigen::VectorXd& y) { return 0.03 + 0.02 * std::sin(1e4 * y[0] + 7e3 * y[1]); }},
    {"sphere-3", "sphere:3", 0.4, 1, 0, true, Spot(Eigen::Vector4d(0, 0, 0, 1), 0.05, 0.06)},
    {"flat-torus-3", "flat-torus:3", 0.6, 1, 0, true,
     [](const Eigen::VectorXd& y) { return 0.3 + 0.1 * y[0]; }},
    {"ellipse", "ellipsoid:1:5", 0.5, 0.01, 0, true, {}},
    {"torus-estimated", "torus:1:0.9", 0.5, 0.05, 0, false, {}},
    {"tanglecube", "tanglecube", 0.2, 0.1, 0, false, {}},
    {"ellipsoid-deviation", "ellipsoid:1:1:10", 0.8, 0, 0.001, false, {}},
    {"ellipsoid-3", "ellipsoid:1:1:1:2", 0.5, 0.15, 0, false, {}},
};

struct Measured {
  double vertices = 0, rounds = 0, certifying = 0, queries = 0, seconds = 0;
  double angle = INFINITY, fatness = INFINITY;
  int certified = 0;
};

void Run(const Case& c, std::uint64_t seed, Measured* all) {
  std::string error;
  const auto manifold = MakeManifold(c.manifold, &error);
  if (!manifold) throw std::runtime_error(error);
  core::Specification spec = SpecificationFor(*manifold, c.epsilon);
  spec.seeds.resize(0, 0);
  if (c.rate > 0) spec.criteria.size_rate = c.rate;
  if (c.deviation > 0) spec.criteria.max_deviation = c.deviation;
  spec.oracle.local_size = c.given;
  spec.random_seed = seed;
  spec.threads = 1;
  auto created = core::Mesher::Create(spec);
  if (!created) throw std::runtime_error(created.error().message);
  core::Mesher& mesher = **created;
  double rounds = 0, queries = 0;  // of the refinement
  while (const core::QueryBatch* batch = mesher.NextBatch()) {
    if (mesher.progress().phase != core::Phase::kCertifying) {
      ++rounds;
      queries += static_cast<double>(batch->size());
    }
    core::Answers answers = AnswersOf(*manifold, *batch);
    if (c.field)
      for (core::AnswerBlock& block : answers.blocks)
        for (Eigen::Index i = 0; i < block.sizes.size(); ++i)
          block.sizes[i] = c.field(block.points.col(i));
    const double begin = ProcessorSeconds();
    if (auto delta = mesher.Absorb(answers); !delta) mesher.Fail(delta.error());
    all->seconds += ProcessorSeconds() - begin;
  }
  const core::Report& report = mesher.report();
  all->vertices += static_cast<double>(report.counts.vertices);
  all->rounds += rounds;
  all->certifying += static_cast<double>(report.counts.rounds) - rounds;
  all->queries += queries;
  all->angle = std::min(all->angle, report.certificate.min_angle_degrees);
  all->fatness = std::min(all->fatness, report.certificate.min_fatness);
  all->certified += report.certificate.certified;
}

int Main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::max(std::atoi(argv[1]), 1) : 1;
  std::printf("%-20s %8s %11s %8s %7s %8s %7s\n", "case", "vertices", "rounds", "queries", "angle",
              "fatness", "cpu s");
  bool good = true;
  for (const Case& c : kCases) {
    if (argc > 2 && std::none_of(argv + 2, argv + argc,
                                 [&](const char* name) { return std::strcmp(name, c.name) == 0; }))
      continue;
    Measured all;
    for (int seed = 1; seed <= seeds; ++seed) Run(c, static_cast<std::uint64_t>(seed), &all);
    std::printf("%-20s %8.0f %5.1f + %3.1f %8.3f %7.2f %8.4f %7.2f  certified %d of %d\n", c.name,
                all.vertices / seeds, all.rounds / seeds, all.certifying / seeds,
                all.queries / all.vertices, all.angle, all.fatness, all.seconds / seeds,
                all.certified, seeds);
    std::fflush(stdout);
    good = good && all.certified == seeds;
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace stellate::testing

int main(int argc, char** argv) { return stellate::testing::Main(argc, argv); }
