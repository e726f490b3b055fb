// Prints how accuracy and size grow with epsilon, as tables and fitted exponents, for built-in
// manifolds meshed in this process. Asserts nothing: tests/core/refinement/slopes_test.cc does.

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/approximation.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

namespace stellate::testing {
namespace {

constexpr double kDegrees = 57.29577951308232;

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

}  // namespace
}  // namespace stellate::testing

int main() {
  try {
    stellate::testing::Accuracy();
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "slopes: %s\n", failure.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
