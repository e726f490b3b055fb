// Prints how accuracy, size and cost grow, as tables and fitted exponents, for built-in manifolds
// meshed in this process. No assertions on anything: tests/core/refinement/slopes_test.cc has
// those.
//
//   slopes [accuracy|dimension|size]...     default: all three

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/approximation.h"
#include "tests/support/run_mesher.h"

namespace stellate::testing {
namespace {

constexpr double kDegrees = 57.29577951308232;

std::unique_ptr<Manifold> Make(const std::string& name) {
  std::string error;
  std::unique_ptr<Manifold> manifold = MakeManifold(name, &error);
  if (manifold == nullptr) throw std::runtime_error(error);
  return manifold;
}

const char* Verdict(const FinishedRun& run) {
  return run.report.certificate.certified ? "yes" : "NO";
}

// Hausdorff distance, vertices and angle against epsilon.
void Accuracy() {
  const struct {
    const char* manifold;
    std::vector<double> epsilons;
  } ranges[] = {
      {"torus:1:0.4", {0.16, 0.08, 0.04, 0.02, 0.01}},
      {"ellipsoid:1:0.8:0.6", {0.2, 0.1, 0.05, 0.025, 0.0125}},
      {"flat-torus:3", {0.4, 0.28, 0.2, 0.14}},
      {"so3", {0.5, 0.35, 0.25, 0.18}},
  };
  std::puts(
      "Accuracy: theory says vertices ~ eps^-k, Hausdorff distance ~ eps^2, angle ~ eps "
      "(degrees).\n");
  for (const auto& range : ranges) {
    const std::unique_ptr<Manifold> manifold = Make(range.manifold);
    std::printf("%s (k = %d, d = %d)\n%10s%10s%11s%13s%12s%12s%11s\n", range.manifold,
                manifold->dimension(), manifold->ambient_dimension(), "eps", "vertices",
                "simplices", "Hausdorff", "mean angle", "max angle", "certified");
    std::vector<double> vertices, hausdorff, mean_angle, max_angle;
    for (const double epsilon : range.epsilons) {
      const FinishedRun run = RunMesher(*manifold, SpecificationFor(*manifold, epsilon));
      const Approximation measured = MeasureApproximation(*manifold, run);
      vertices.push_back(static_cast<double>(run.points.cols()));
      hausdorff.push_back(measured.hausdorff);
      mean_angle.push_back(measured.mean_angle);
      max_angle.push_back(measured.max_angle);
      std::printf("%10g%10lld%11llu%13.3e%12.3f%12.3f%11s\n", epsilon,
                  static_cast<long long>(run.points.cols()),
                  static_cast<unsigned long long>(run.report.counts.simplices), measured.hausdorff,
                  measured.mean_angle * kDegrees, measured.max_angle * kDegrees, Verdict(run));
      std::fflush(stdout);
    }
    std::printf("%10s%10.2f%11s%13.2f%12.2f%12.2f\n\n", "exponent",
                FitExponent(range.epsilons, vertices), "", FitExponent(range.epsilons, hausdorff),
                FitExponent(range.epsilons, mean_angle), FitExponent(range.epsilons, max_angle));
  }
}

// Processor time against the ambient dimension, the manifold staying the same.
void Dimension() {
  std::puts("Cost against d, one thread: theory says linear, so an exponent of at most 1.\n");
  std::printf("torus:1:0.4@d, eps = 0.02\n%6s%10s%10s%16s%16s%11s\n", "d", "vertices", "queries",
              "mesher us/vert", "oracle us/vert", "certified");
  std::vector<double> dimensions, cost;
  for (const int d : {3, 6, 10, 20, 30, 50, 100}) {
    const auto manifold = Make("torus:1:0.4@" + std::to_string(d));
    core::Specification spec = SpecificationFor(*manifold, 0.02);
    spec.threads = 1;
    const FinishedRun run = RunMesher(*manifold, spec);
    const double per_vertex = 1e6 / static_cast<double>(run.points.cols());
    dimensions.push_back(d);
    cost.push_back(run.mesher_seconds * per_vertex);
    std::printf("%6d%10lld%10llu%16.1f%16.1f%11s\n", d, static_cast<long long>(run.points.cols()),
                static_cast<unsigned long long>(run.report.counts.queries), cost.back(),
                run.oracle_seconds * per_vertex, Verdict(run));
    std::fflush(stdout);
  }
  std::printf("exponent %.2f over all, %.2f from d = %g to 100\n\n", FitExponent(dimensions, cost),
              FitExponent({dimensions.end() - 3, dimensions.end()}, {cost.end() - 3, cost.end()}),
              *(dimensions.end() - 3));
}

// Round trips, queries and processor time against the number of vertices.
void Size() {
  std::puts("Cost against size, one thread: theory says a vertex costs the same in any mesh.\n");
  const struct {
    const char* manifold;
    std::vector<double> epsilons;
  } ranges[] = {{"torus:1:0.4", {0.08, 0.025, 0.008, 0.004}}, {"flat-torus:3", {0.3, 0.2, 0.13}}};
  for (const auto& range : ranges) {
    std::printf("%s\n%10s%10s%8s%14s%12s%16s%11s\n", range.manifold, "eps", "vertices", "rounds",
                "queries/vert", "vertices/s", "mesher us/vert", "certified");
    const std::unique_ptr<Manifold> manifold = Make(range.manifold);
    for (const double epsilon : range.epsilons) {
      core::Specification spec = SpecificationFor(*manifold, epsilon);
      spec.threads = 1;
      const FinishedRun run = RunMesher(*manifold, spec);
      const double n = static_cast<double>(run.points.cols());
      std::printf("%10g%10.0f%8llu%14.2f%12.0f%16.1f%11s\n", epsilon, n,
                  static_cast<unsigned long long>(run.report.counts.rounds),
                  static_cast<double>(run.report.counts.queries) / n, n / run.mesher_seconds,
                  1e6 * run.mesher_seconds / n, Verdict(run));
      std::fflush(stdout);
    }
    std::puts("");
  }
}

int Main(const std::vector<std::string>& sections) {
  for (const std::string& section : sections) {
    if (section == "accuracy") {
      Accuracy();
    } else if (section == "dimension") {
      Dimension();
    } else if (section == "size") {
      Size();
    } else {
      std::fprintf(stderr, "slopes: no section '%s'; there are accuracy, dimension, size\n",
                   section.c_str());
      return EXIT_FAILURE;
    }
  }
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace stellate::testing

int main(int argc, char** argv) {
  std::vector<std::string> sections(argv + 1, argv + argc);
  if (sections.empty()) sections = {"accuracy", "dimension", "size"};
  try {
    return stellate::testing::Main(sections);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "slopes: %s\n", failure.what());
    return EXIT_FAILURE;
  }
}
