#include "core/run/tangent_fits.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "core/base/random.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::FramedPoints;
using testing::Make;
using testing::RandomPointsOn;
using enum TangentFits::Knowledge;

// Random points of a manifold, with its tangent spaces turned by `noise`.
class TangentFitsTest : public ::testing::TestWithParam<std::string> {
 protected:
  TangentFitsTest()
      : manifold_(Make(GetParam())),
        k_(manifold_->dimension()),
        d_(manifold_->ambient_dimension()) {}

  FramedPoints Frame(const Eigen::MatrixXd& points) {
    FramedPoints framed;
    framed.k = k_;
    framed.d = d_;
    framed.Append(points, manifold_->TangentBasis(points));
    return framed;
  }
  Eigen::MatrixXd TangentsOf(const FramedPoints& framed, double noise) const {
    Eigen::MatrixXd tangents =
        Eigen::Map<const Eigen::MatrixXd>(framed.tangents.data(), k_ * d_, framed.size());
    Random random(4, 4);
    for (Eigen::Index c = 0; c < tangents.cols(); ++c) {
      Eigen::Map<Eigen::MatrixXd> basis(tangents.col(c).data(), d_, k_);
      for (double& x : basis.reshaped()) x += noise * random.NearlyNormal();
      const Eigen::HouseholderQR<Eigen::MatrixXd> qr(basis);
      basis = qr.householderQ() * Eigen::MatrixXd::Identity(d_, k_);
    }
    return tangents;
  }
  double Error(const Eigen::MatrixXd& found, const FramedPoints& exact, std::uint32_t i) const {
    const Eigen::Map<const Eigen::MatrixXd> basis(exact.Tangent(i), d_, k_);
    return (found - basis * (basis.transpose() * found)).operatorNorm();
  }

  // The mean error at other points, from `count` known ones. Guesses are turned by 0.1.
  double MeanError(int count, double noise) {
    const FramedPoints known = Frame(RandomPointsOn(*manifold_, count, 1));
    const FramedPoints others = Frame(RandomPointsOn(*manifold_, 60, 2));
    TangentFits fits(k_, d_);
    const Eigen::Map<const Eigen::MatrixXd> points(known.points.data(), d_, count);
    fits.Know(points, TangentsOf(known, noise), Eigen::MatrixXd::Zero(d_, count),
              std::vector(static_cast<std::size_t>(count), kEstimate));
    fits.Look(Eigen::Map<const Eigen::MatrixXd>(others.points.data(), d_, others.size()));
    const Eigen::MatrixXd guesses = TangentsOf(others, 0.1 / d_);
    double sum = 0;
    for (std::uint32_t i = 0; i < others.size(); ++i) {
      const auto fit = fits.At(i, guesses.col(i).data());
      EXPECT_TRUE(fit.has_value());
      if (fit) sum += Error(fit->tangents, others, i);
    }
    return sum / others.size();
  }

  std::unique_ptr<Manifold> manifold_;
  int k_, d_;
};

TEST_P(TangentFitsTest, FindTangentSpacesFromPointsNearBy) {
  const double coarse = MeanError(3000, 0), fine = MeanError(48000, 0);
  EXPECT_LT(coarse, 0.05);
  EXPECT_LT(fine, coarse / 3);
}

TEST_P(TangentFitsTest, GiveBackLessOfAnErrorThanTheyAreGiven) {
  const double noise = 0.02 / d_;
  EXPECT_LT(MeanError(48000, noise), 0.02);
}

TEST_P(TangentFitsTest, RefineEstimatesAndKeepWhatIsExact) {
  constexpr int kCount = 30000;
  const FramedPoints known = Frame(RandomPointsOn(*manifold_, kCount, 1));
  const Eigen::Map<const Eigen::MatrixXd> points(known.points.data(), d_, kCount);
  const Eigen::MatrixXd before = TangentsOf(known, 0.05 / d_);
  std::vector<TangentFits::Knowledge> knowledge(kCount, kEstimate);
  for (std::size_t i = 0; i < kCount; i += 10) knowledge[i] = kExact;
  TangentFits fits(k_, d_);
  fits.Know(points, before, Eigen::MatrixXd::Zero(d_, kCount), knowledge);
  Eigen::MatrixXd after = before;
  fits.Refine(points, 0.1, &after);
  double was = 0, is = 0;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    was += Error(Eigen::Map<const Eigen::MatrixXd>(before.col(i).data(), d_, k_), known, i);
    is += Error(Eigen::Map<const Eigen::MatrixXd>(after.col(i).data(), d_, k_), known, i);
    if (i % 10 == 0) {
      EXPECT_EQ(after.col(i), before.col(i));
    }
  }
  EXPECT_LT(is, 0.6 * was);
}

TEST_P(TangentFitsTest, AreNothingWhereNothingIsNear) {
  TangentFits fits(k_, d_);
  const FramedPoints one = Frame(RandomPointsOn(*manifold_, 1, 1));
  fits.Look(Eigen::Map<const Eigen::MatrixXd>(one.points.data(), d_, 1));
  EXPECT_FALSE(fits.At(0, one.Tangent(0)).has_value());
  fits.Know(Eigen::Map<const Eigen::MatrixXd>(one.points.data(), d_, 1), TangentsOf(one, 0),
            Eigen::MatrixXd::Zero(d_, 1), {kExact});
  EXPECT_FALSE(fits.At(0, one.Tangent(0)).has_value());  // only itself
}

INSTANTIATE_TEST_SUITE_P(Catalogue, TangentFitsTest,
                         ::testing::Values("clifford-torus", "so3", "torus-knot:2:3", "rp2"));

}  // namespace
}  // namespace stellate::core
