#include "core/run/tangent_finder.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <string>

#include "core/base/random.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::FramedPoints;
using testing::Make;
using testing::RandomPointsOn;

constexpr int kPoints = 40;
constexpr double kStep = 0.003;

class TangentFinderTest : public ::testing::TestWithParam<std::string> {
 protected:
  TangentFinderTest()
      : manifold_(Make(GetParam())),
        k_(manifold_->dimension()),
        d_(manifold_->ambient_dimension()),
        finder_(k_, d_, kStep, 1) {
    exact_.k = k_;
    exact_.d = d_;
    points_ = RandomPointsOn(*manifold_, kPoints, 3);
    exact_.Append(points_, manifold_->TangentBasis(points_));
  }

  // Answers until nothing is asked for. `missing`: whether a query goes unanswered.
  template <typename Missing>
  Eigen::Index Finish(Missing&& missing) {
    Eigen::Index asked = 0;
    for (std::vector<QueryBlock> blocks; !(blocks = finder_.Questions()).empty();) {
      EXPECT_EQ(blocks.front().kind, QueryKind::kClosestPoint);
      EXPECT_FALSE(blocks.front().want.tangents);
      AnswerBlock answers;
      answers.points = manifold_->ClosestPoint(blocks.front().points).points;
      answers.found.assign(static_cast<std::size_t>(blocks.front().size()), 1);
      for (Eigen::Index j = 0; j < blocks.front().size(); ++j)
        if (missing(asked + j)) answers.found[static_cast<std::size_t>(j)] = 0;
      asked += blocks.front().size();
      finder_.Absorb({answers});
    }
    return asked;
  }
  Eigen::Index Finish() {
    return Finish([](Eigen::Index) { return false; });
  }

  Eigen::Map<const Eigen::MatrixXd> Exact(std::uint32_t i) const {
    return {exact_.Tangent(i), d_, k_};
  }

  // Largest sine between the found tangent space of point i and the exact one.
  double Error(std::uint32_t i) const {
    const Eigen::Map<const Eigen::MatrixXd> found(finder_.tangents().col(i).data(), d_, k_);
    return (found - Exact(i) * (Exact(i).transpose() * found)).operatorNorm();
  }

  void ExpectAllFound() const {
    ASSERT_EQ(finder_.tangents().cols(), kPoints);
    for (std::uint32_t i = 0; i < kPoints; ++i) {
      EXPECT_TRUE(finder_.ok()[i]) << "point " << i;
      const Eigen::Map<const Eigen::MatrixXd> found(finder_.tangents().col(i).data(), d_, k_);
      EXPECT_LT((found.transpose() * found - Eigen::MatrixXd::Identity(k_, k_)).norm(), 1e-12);
      EXPECT_LT(Error(i), 2e-3) << "point " << i;  // far below what meshing tolerates, 0.03
    }
  }

  // The exact basis of point i, each vector turned by `angle` towards a random direction.
  std::vector<double> Turned(std::uint32_t i, double angle) const {
    Random random(i, 17);
    Eigen::MatrixXd basis = Exact(i);
    for (int a = 0; a < k_; ++a) {
      Eigen::VectorXd u(d_);
      for (double& x : u) x = random.NearlyNormal();
      u -= Exact(i) * (Exact(i).transpose() * u);
      basis.col(a) = std::cos(angle) * basis.col(a) + std::sin(angle) * u.normalized();
    }
    const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(basis).householderQ() *
                              Eigen::MatrixXd::Identity(d_, k_);
    return {q.data(), q.data() + q.size()};
  }

  void StartWithGuesses(double angle) {
    guesses_.clear();
    std::vector<const double*> pointers;
    for (std::uint32_t i = 0; i < kPoints; ++i) guesses_.push_back(Turned(i, angle));
    for (const auto& g : guesses_) pointers.push_back(g.data());
    finder_.Start({points_, pointers});
  }

  std::unique_ptr<Manifold> manifold_;
  int k_, d_;
  TangentFinder finder_;
  FramedPoints exact_;
  Eigen::MatrixXd points_;
  std::vector<std::vector<double>> guesses_;
};

TEST_P(TangentFinderTest, FindsTangentsFromNothing) {
  finder_.Start({points_, std::vector<const double*>(kPoints, nullptr)});
  const Eigen::Index asked = Finish();
  ExpectAllFound();
  EXPECT_EQ(asked, kPoints * 2 * std::min(k_ + 4, d_));  // however large d is
}

TEST_P(TangentFinderTest, FindsTangentsNearAGuessInTwoQueriesADirection) {
  StartWithGuesses(0.3);
  const Eigen::Index asked = Finish();
  ExpectAllFound();
  EXPECT_EQ(asked, kPoints * 2 * k_);
}

TEST_P(TangentFinderTest, RecoversFromGuessesThatAreFarOff) {
  if (d_ < 2 * k_) return SUCCEED();  // no room to be at right angles
  StartWithGuesses(1.55);
  const Eigen::Index asked = Finish();
  ExpectAllFound();
  EXPECT_EQ(asked, kPoints * 2 * (k_ + std::min(k_ + 4, d_)));
}

// The bound holds for the true reach, and what random directions show poorly is looked at again.
TEST_P(TangentFinderTest, BoundsWhatItMayBeWrongBy) {
  const double reach = manifold_->facts().reach.value_or(0);
  if (reach == 0) return SUCCEED();
  finder_.Start({points_, std::vector<const double*>(kPoints, nullptr)});
  Finish();
  const double poor = finder_.error_length();
  for (std::uint32_t i = 0; i < kPoints; ++i) EXPECT_LE(Error(i), poor / reach) << "point " << i;
  const double most = 3 * kStep * std::sqrt(k_);
  finder_ = TangentFinder(k_, d_, kStep, 1, most);
  finder_.Start({points_, std::vector<const double*>(kPoints, nullptr)});
  Finish();
  ExpectAllFound();
  EXPECT_LE(finder_.error_length(), most);
  EXPECT_GT(finder_.error_length(), 0);
  for (std::uint32_t i = 0; i < kPoints; ++i)
    EXPECT_LE(Error(i), finder_.error_length() / reach) << "point " << i;
}

TEST_P(TangentFinderTest, SaysWhereAnswersWereMissing) {
  finder_.Start({points_, std::vector<const double*>(kPoints, nullptr)});
  const Eigen::Index each = 2 * std::min(k_ + 4, d_);
  Finish([&](Eigen::Index query) { return query / each % 3 == 0 && query % each == 1; });
  for (std::uint32_t i = 0; i < kPoints; ++i) {
    EXPECT_EQ(finder_.ok()[i] != 0, i % 3 != 0) << "point " << i;
    if (i % 3 == 0)
      EXPECT_EQ(finder_.tangents().col(i).norm(), 0);
    else
      EXPECT_LT(Error(i), 2e-3);
  }
}

TEST_P(TangentFinderTest, TriesAgainWithoutAGuessWhereAnswersWereMissing) {
  StartWithGuesses(0.2);
  Finish([&](Eigen::Index query) { return query == 0; });
  ExpectAllFound();
}

TEST_P(TangentFinderTest, IsDeterministicAndCanStartAgain) {
  const std::vector<const double*> none(kPoints, nullptr);
  finder_.Start({points_, none});
  Finish();
  const Eigen::MatrixXd first = finder_.tangents();
  StartWithGuesses(0.3);
  Finish();
  finder_.Start({points_, none});
  Finish();
  EXPECT_EQ(finder_.tangents(), first);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, TangentFinderTest,
                         ::testing::Values("torus", "so3", "sphere:2:50", "rp2", "circle:10"));

// Normals read off answers, in codimension 1.
class NormalsTest : public ::testing::Test {
 protected:
  static constexpr Eigen::Index kAsked = 400;

  // Random points a little off the torus, and what `answer` makes of them.
  template <typename Answer>
  Eigen::Index Find(Answer&& answer, std::uint64_t seed) {
    Random random(seed, 5);
    TangentFinder::Points of;
    of.points = RandomPointsOn(*torus_, kAsked, seed);
    of.asked = of.points;
    for (double& x : of.asked.reshaped()) x += 0.05 * random.NearlyNormal();
    of.points = answer(of.asked);
    of.guesses.resize(kAsked, nullptr);
    points_ = of.points;
    finder_.Start(std::move(of));
    Eigen::Index asked = 0;
    for (std::vector<QueryBlock> blocks; !(blocks = finder_.Questions()).empty();) {
      asked += blocks.front().size();
      AnswerBlock answers;
      answers.points = answer(blocks.front().points);
      finder_.Absorb({answers});
    }
    return asked;
  }
  double WorstError() const {
    const Eigen::MatrixXd bases = torus_->TangentBasis(points_);
    double worst = 0;
    for (Eigen::Index i = 0; i < kAsked; ++i) {
      const Eigen::Map<const Eigen::MatrixXd> found(finder_.tangents().col(i).data(), 3, 2);
      Eigen::MatrixXd exact(3, 2);
      for (int j = 0; j < 6; ++j) exact(j / 2, j % 2) = bases(j, i);
      worst = std::max(worst, (found - exact * (exact.transpose() * found)).operatorNorm());
      EXPECT_LT((found.transpose() * found - Eigen::Matrix2d::Identity()).norm(), 1e-12);
    }
    return worst;
  }
  Eigen::MatrixXd Closest(const Eigen::MatrixXd& x) { return torus_->ClosestPoint(x).points; }

  std::unique_ptr<Manifold> torus_ = Make("torus");
  TangentFinder finder_{2, 3, kStep, 1};
  Eigen::MatrixXd points_;
};

TEST_F(NormalsTest, CostNothingOnceSomeHaveAgreedWithDifferences) {
  const auto exact = [&](const Eigen::MatrixXd& x) { return Closest(x); };
  EXPECT_LE(Find(exact, 1), 6 * 72);  // some lie too near to their queries
  EXPECT_LT(WorstError(), 1e-3);
  EXPECT_LE(Find(exact, 2), 6 * 40);
  EXPECT_LT(WorstError(), 1e-3);
}

TEST_F(NormalsTest, MayBeWrongByWhatTheAnswersAreOverTheirLength) {
  std::uint64_t count = 0;
  const auto inexact = [&](const Eigen::MatrixXd& x) {
    Eigen::MatrixXd y = Closest(x);
    Random random(++count, 3);
    for (double& c : y.reshaped()) c += 1e-6 * (2 * random.Uniform() - 1);
    return y;
  };
  EXPECT_LE(Find(inexact, 1), 6 * 72);
  EXPECT_LT(WorstError(), 4 * 5e-6 / kStep);
  const auto single = [&](const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
    return Closest(x.cast<float>().cast<double>()).cast<float>().cast<double>();
  };
  EXPECT_LE(Find(single, 2), 6 * 40);
  EXPECT_LT(WorstError(), 1e-3);
}

// Answers that do not lie straight below what was asked: a step along M is added, which grows with
// the distance.
TEST_F(NormalsTest, AreNotReadOffAnswersThatLieAside) {
  const auto aside = [&](const Eigen::MatrixXd& x) {
    const Eigen::MatrixXd y = Closest(x);
    return Closest(y + 0.2 * (x - y).colwise().norm().replicate(3, 1).cwiseProduct(
                                 Eigen::Vector3d(0.3, 0.5, 0.8).replicate(1, x.cols())));
  };
  EXPECT_EQ(Find(aside, 1), 6 * kAsked);
  EXPECT_FALSE(finder_.reads_normals());
  EXPECT_EQ(Find(aside, 2), 6 * kAsked);
}

// One that comes late is as telling as one that comes early.
TEST_F(NormalsTest, AreNoLongerReadOnceOneDisagreed) {
  Find([&](const Eigen::MatrixXd& x) { return Closest(x); }, 1);
  ASSERT_TRUE(finder_.reads_normals());
  const Eigen::MatrixXd on = RandomPointsOn(*torus_, 1, 9);
  const Eigen::MatrixXd basis = torus_->TangentBasis(on);
  TangentFinder::Points of;
  of.points = on;
  const Eigen::Vector3d along(basis(0, 0), basis(2, 0), basis(4, 0));
  of.asked = on + 0.1 * along;  // as on an undeclared boundary
  std::vector<double> guess(6);
  ToByVector(basis.col(0).data(), 3, 2, guess.data());
  of.guesses = {guess.data()};
  finder_.Start(std::move(of));
  ASSERT_FALSE(finder_.is_done());  // it is turned too far from its guess
  for (std::vector<QueryBlock> blocks; !(blocks = finder_.Questions()).empty();) {
    AnswerBlock answers;
    answers.points = Closest(blocks.front().points);
    finder_.Absorb({answers});
  }
  EXPECT_FALSE(finder_.reads_normals());
}

TEST_F(NormalsTest, AreTheSameHoweverOftenItStartsAgain) {
  const auto exact = [&](const Eigen::MatrixXd& x) { return Closest(x); };
  Find(exact, 1);
  Find(exact, 2);
  const Eigen::MatrixXd once = finder_.tangents();
  finder_ = TangentFinder(2, 3, kStep, 1);
  Find(exact, 1);
  Find(exact, 2);
  EXPECT_EQ(finder_.tangents(), once);
}

// A surface taken for a curve has no tangent line, and a curve taken for a surface no plane.
TEST(TangentFinder, RefusesTheWrongDimension) {
  for (const bool too_many : {false, true}) {
    const auto manifold = Make(too_many ? "circle:10" : "flat-torus:4");
    TangentFinder finder(too_many ? 2 : 1, manifold->ambient_dimension(), kStep, 1);
    const Eigen::MatrixXd points = RandomPointsOn(*manifold, kPoints, 3);
    finder.Start({points, std::vector<const double*>(kPoints, nullptr)});
    for (std::vector<QueryBlock> blocks; !(blocks = finder.Questions()).empty();)
      finder.Absorb({{manifold->ClosestPoint(blocks.front().points).points, {}, {}, {}, {}, {}}});
    int refused = 0;
    for (const std::uint8_t ok : finder.ok()) refused += !ok;
    EXPECT_GE(refused, kPoints * 3 / 4) << manifold->facts().spec;
  }
}

}  // namespace
}  // namespace stellate::core
