// Whole meshes: rounds/, graded/, certificate/, dimension/ and threads/. The time is the mesher's
// own, without the oracle's: the processor's on one thread, and by the clock in threads/.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "tests/bench/timings.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

namespace stellate::bench {
namespace {

using testing::Make;

using benchmark::State;
using testing::ProcessorSeconds;
using Field = std::function<double(const Eigen::VectorXd&)>;  // a length at a point of M

bool all_are_right = true;

struct Stage {
  double seconds = 0, rounds = 0, queries = 0;
};

struct Meshed {
  Stage refinement, certificate;  // the round that ends the one and begins the other takes its time
                                  // in the second, and is counted in the first
  core::Report report;
  std::uint64_t fingerprint = 0;  // of all coordinates and simplices

  double seconds() const { return refinement.seconds + certificate.seconds; }
};

double ClockSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::uint64_t Fingerprint(const core::Mesher& mesher) {
  std::uint64_t sum = 0;
  const Eigen::MatrixXd points = mesher.Points();
  for (const double x : points.reshaped()) sum = core::Mix64(sum ^ std::bit_cast<std::uint64_t>(x));
  for (const std::uint32_t id : mesher.Simplices()) sum = core::Mix64(sum ^ id);
  return sum;
}

core::Specification SpecificationOf(const Manifold& manifold, double epsilon) {
  core::Specification spec = testing::SpecificationFor(manifold, epsilon);
  spec.limits.max_vertices = 100'000'000;
  return spec;
}

Meshed Mesh(Manifold& manifold, const core::Specification& spec, const Field& sizes = {},
            double (*seconds)() = ProcessorSeconds, int threads = 1) {
  auto created = core::Mesher::Create(spec, {.threads = threads});
  if (!created) throw std::runtime_error(created.error().message);
  core::Mesher& mesher = **created;
  Meshed meshed;
  const auto certifies = [&] { return mesher.progress().phase == core::Phase::kCertifying; };
  while (const auto batch = mesher.NextBatch()) {
    Stage& stage = certifies() ? meshed.certificate : meshed.refinement;
    ++stage.rounds;
    stage.queries += static_cast<double>(batch->size());
    core::Answers answers = testing::AnswersOf(manifold, *batch);
    if (sizes)
      for (core::AnswerBlock& block : answers.blocks)
        for (Eigen::Index i = 0; i < block.sizes.size(); ++i)
          block.sizes[i] = sizes(block.points.col(i));
    const bool begun = certifies();
    const double begin = seconds();
    if (auto delta = mesher.Absorb(answers); !delta) mesher.Fail(delta.error());
    (begun || certifies() ? meshed.certificate : meshed.refinement).seconds += seconds() - begin;
  }
  meshed.report = mesher.report();
  meshed.fingerprint = Fingerprint(mesher);
  return meshed;
}

// What a table shows beside the time.
void Tell(const Meshed& meshed, State& state) {
  const auto vertices = static_cast<double>(meshed.report.counts.vertices);
  const core::Certificate& certificate = meshed.report.certificate;
  state.counters["vertices"] = vertices;
  state.counters["rounds"] = meshed.refinement.rounds;
  state.counters["certifying"] = meshed.certificate.rounds;
  state.counters["queries/v"] = meshed.refinement.queries / vertices;
  state.counters["us/v"] = 1e6 * meshed.seconds() / vertices;
  state.counters["angle"] = certificate.min_angle_degrees;
  state.counters["fatness"] = certificate.min_fatness;
  state.SetLabel(certificate.certified ? "certified" : certificate.verdict);
  all_are_right = all_are_right && certificate.certified;
}

// Adds a benchmark of one mesh a repetition; of --benchmark_repetitions also the least figures.
template <typename Run>
benchmark::internal::Benchmark* Register(const std::string& name, Run run) {
  const auto least = [](const std::vector<double>& v) {
    return *std::min_element(v.begin(), v.end());
  };
  return benchmark::RegisterBenchmark(name.c_str(), std::move(run))
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond)
      ->ComputeStatistics("least", least);
}

std::string NameOf(const char* family, const Work& work) {
  char epsilon[30];
  std::snprintf(epsilon, sizeof(epsilon), "%g", work.epsilon);
  return std::string(family) + '/' + work.manifold + '/' + epsilon;
}

// Plain and speculative runs; each repetition has a random seed of its own.
void RegisterRounds(const Work& work) {
  const auto manifold = Make(work.manifold);
  for (const bool speculative : {false, true}) {
    Register(NameOf("rounds", work) + (speculative ? "/speculative" : "/plain"),
             [=, seed = std::uint64_t{0}](State& state) mutable {
               core::Specification spec = SpecificationOf(*manifold, work.epsilon);
               spec.seeds.resize(0, 0);
               spec.criteria.speculative = speculative;
               spec.random_seed = ++seed;
               for ([[maybe_unused]] auto _ : state) {
                 const Meshed meshed = Mesh(*manifold, spec);
                 state.SetIterationTime(meshed.seconds());
                 Tell(meshed, state);
               }
             });
  }
}

struct Graded {
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

const Graded kGraded[] = {
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

// Sizes given and estimated; each repetition has a random seed of its own.
void RegisterGraded(const Graded& c) {
  const auto manifold = Make(c.manifold);
  Register(std::string("graded/") + c.name, [=, seed = std::uint64_t{0}](State& state) mutable {
    core::Specification spec = SpecificationOf(*manifold, c.epsilon);
    spec.seeds.resize(0, 0);
    if (c.rate > 0) spec.criteria.size_rate = c.rate;
    if (c.deviation > 0) spec.criteria.max_deviation = c.deviation;
    spec.oracle.local_size = c.given;
    spec.random_seed = ++seed;
    for ([[maybe_unused]] auto _ : state) {
      const Meshed meshed = Mesh(*manifold, spec, c.field);
      state.SetIterationTime(meshed.seconds());
      Tell(meshed, state);
    }
  });
}

// What the certificate costs beside the mesh.
void RegisterCertificate(const Work& work) {
  const auto manifold = Make(work.manifold);
  Register(NameOf("certificate", work), [=](State& state) {
    core::Specification spec = SpecificationOf(*manifold, work.epsilon);
    spec.random_seed = 1;
    for ([[maybe_unused]] auto _ : state) {
      const Meshed meshed = Mesh(*manifold, spec);
      state.SetIterationTime(meshed.seconds());
      Tell(meshed, state);
      state.counters["refine_ms"] = 1e3 * meshed.refinement.seconds;
      state.counters["certify_ms"] = 1e3 * meshed.certificate.seconds;
      state.counters["certify_queries"] = meshed.certificate.queries;
    }
  });
}

// Against the ambient dimension, the manifold staying the same: theory says linear.
void RegisterDimension() {
  auto* const benchmark = Register("dimension/torus:1:0.4", [](State& state) {
    const auto manifold = Make("torus:1:0.4@" + std::to_string(state.range(0)));
    for ([[maybe_unused]] auto _ : state) {
      const Meshed meshed = Mesh(*manifold, SpecificationOf(*manifold, 0.02));
      state.SetIterationTime(meshed.seconds());
      Tell(meshed, state);
    }
    state.SetComplexityN(state.range(0));
  });
  for (const int d : {3, 6, 10, 20, 30, 50, 100}) benchmark->Arg(d);
  benchmark->ArgName("d")->Complexity();
}

// One core and several. From T(n) on n cores follows the serial share s of Amdahl's law,
// T(n) = T(1) (s + (1 - s) / n), and what it lets 64 cores gain. The best of three runs.
void RegisterThreads(const Work& work) {
  const auto manifold = Make(work.manifold);
  const auto one = std::make_shared<Meshed>();
  const int cores = std::max(2, static_cast<int>(std::thread::hardware_concurrency()));
  for (int threads = 1; threads <= cores; threads *= 2) {
    Register(NameOf("threads", work) + '/' + std::to_string(threads), [=](State& state) {
      const core::Specification spec = SpecificationOf(*manifold, work.epsilon);
      for ([[maybe_unused]] auto _ : state) {
        Meshed best = Mesh(*manifold, spec, {}, ClockSeconds, threads);
        for (int run = 1; run < 3; ++run)
          if (const Meshed next = Mesh(*manifold, spec, {}, ClockSeconds, threads);
              next.seconds() < best.seconds())
            best = next;
        state.SetIterationTime(best.seconds());
        Tell(best, state);
        if (threads == 1) *one = best;
        if (threads == 1 || one->fingerprint == 0) continue;
        const double share = best.seconds() / one->seconds();
        const double serial = std::clamp((share - 1.0 / threads) / (1 - 1.0 / threads), 0.0, 1.0);
        state.counters["gain"] = 1 / share;
        state.counters["serial"] = serial;
        state.counters["at_64"] = 1 / (serial + (1 - serial) / 64);
        if (best.fingerprint == one->fingerprint) continue;
        state.SetLabel("ANOTHER MESH than that of one thread");
        all_are_right = false;
      }
    });
  }
}

}  // namespace

void RegisterMeshes(const std::vector<Work>& asked) {
  const auto table = [&](std::vector<Work> own) { return asked.empty() ? std::move(own) : asked; };
  for (const Work& work : table({{"sphere", 0.1},
                                 {"sphere", 0.03},
                                 {"sphere", 0.0092},
                                 {"torus:1:0.4", 0.05},
                                 {"torus:1:0.4", 0.0103},
                                 {"torus:1:0.4", 0.004},
                                 {"tanglecube", 0.1},
                                 {"tanglecube", 0.03},
                                 {"two-spheres", 0.013},
                                 {"rp2", 0.05},
                                 {"clifford-torus", 0.05},
                                 {"flat-torus:3", 0.4},
                                 {"flat-torus:3", 0.206},
                                 {"flat-torus:3", 0.13},
                                 {"so3", 0.35},
                                 {"so3", 0.2}}))
    RegisterRounds(work);
  for (const Work& work : table({{"torus:1:0.4", 0.02}, {"sphere:3:4", 0.2}, {"so3", 0.25}}))
    RegisterCertificate(work);
  for (const Work& work : table({{"sphere", 0.0092},
                                 {"torus:1:0.4", 0.0103},
                                 {"torus:1:0.4", 0.0033},
                                 {"flat-torus:3", 0.206},
                                 {"so3", 0.2}}))
    RegisterThreads(work);
  if (!asked.empty()) return;
  for (const Graded& graded : kGraded) RegisterGraded(graded);
  RegisterDimension();
}

bool AllMeshesAreRight() { return all_are_right; }

}  // namespace stellate::bench
