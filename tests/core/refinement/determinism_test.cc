// Specification and answers determine the mesh bit for bit, and the deltas tell all of it.

#include <gtest/gtest.h>

#include <string>

#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AnswererFor;
using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::SameMesh;
using testing::SpecificationFor;

struct RepeatedCase {
  std::string manifold;
  double epsilon;
  bool poor = false;  // closest points alone
};

void PrintTo(const RepeatedCase& c, std::ostream* out) {
  *out << c.manifold << " epsilon " << c.epsilon << (c.poor ? " poor" : "");
}

class Determinism : public ::testing::TestWithParam<RepeatedCase> {
 protected:
  Determinism()
      : manifold_(Make(GetParam().manifold)),
        spec_(SpecificationFor(*manifold_, GetParam().epsilon)) {
    if (GetParam().poor) spec_.oracle = {};
  }

  std::unique_ptr<Manifold> manifold_;
  Specification spec_;
};

TEST_P(Determinism, TheNumberOfThreadsDoesNotMatter) {
  const Execution alone{.threads = 1};
  const DrivenRun one = Drive(spec_, *manifold_, alone), again = Drive(spec_, *manifold_, alone);
  ASSERT_EQ(one.report().termination, Termination::kConverged);
  EXPECT_TRUE(SameMesh(*one.mesher, *again.mesher));
  for (const int threads : {2, 4, 0}) {
    const DrivenRun many = Drive(spec_, *manifold_, {.threads = threads});
    EXPECT_TRUE(SameMesh(*one.mesher, *many.mesher)) << threads << " threads";
    ASSERT_EQ(many.deltas.size(), one.deltas.size());
    for (std::size_t r = 0; r < one.deltas.size(); ++r) {
      EXPECT_EQ(many.deltas[r].added, one.deltas[r].added) << "round " << r + 1;
      EXPECT_EQ(many.deltas[r].removed, one.deltas[r].removed) << "round " << r + 1;
    }
  }
}

TEST_P(Determinism, RandomSeedsGiveOtherMeshesOfTheSameManifold) {
  const DrivenRun one = Drive(spec_, *manifold_);
  spec_.random_seed = 2;
  const DrivenRun other = Drive(spec_, *manifold_);
  EXPECT_FALSE(SameMesh(*one.mesher, *other.mesher));
  EXPECT_EQ(other.report().termination, Termination::kConverged);
  EXPECT_EQ(other.report().certificate.euler_characteristic,
            one.report().certificate.euler_characteristic);
}

TEST_P(Determinism, DeltasAddUpToTheMesh) {
  const auto mesher = testing::NewMesher(spec_);
  const auto stride = static_cast<std::size_t>(spec_.dimension) + 1;
  std::set<std::vector<std::uint32_t>> simplices;
  Eigen::MatrixXd points(spec_.ambient_dimension, 0);
  std::uint64_t revision = 0;
  double fraction = 0;
  const auto each = [&](const std::vector<std::uint32_t>& flat, auto&& use) {
    ASSERT_EQ(flat.size() % stride, 0u);
    for (auto at = flat.begin(); at != flat.end(); at += static_cast<std::ptrdiff_t>(stride))
      use(std::vector<std::uint32_t>(at, at + static_cast<std::ptrdiff_t>(stride)));
  };
  while (const auto batch = mesher->NextBatch()) {
    EXPECT_EQ(batch->round, revision + 1);
    EXPECT_GT(batch->size(), 0);
    const MeshDelta delta = testing::Step(*mesher, AnswererFor(*manifold_));
    EXPECT_EQ(delta.revision, ++revision);
    ASSERT_EQ(delta.first_vertex, static_cast<std::uint64_t>(points.cols()));
    points.conservativeResize(Eigen::NoChange, points.cols() + delta.points.cols());
    points.rightCols(delta.points.cols()) = delta.points;
    each(delta.removed, [&](const auto& s) { EXPECT_EQ(simplices.erase(s), 1u); });
    each(delta.added, [&](const auto& s) {
      EXPECT_TRUE(std::is_sorted(s.begin(), s.end()));
      EXPECT_LT(s.back(), points.cols());
      EXPECT_TRUE(simplices.insert(s).second);
    });
    const Progress& progress = mesher->progress();
    EXPECT_EQ(progress.round, revision);
    EXPECT_EQ(progress.vertices, static_cast<std::uint64_t>(points.cols()));
    EXPECT_EQ(progress.simplices, simplices.size());
    EXPECT_GE(progress.fraction, fraction);
    EXPECT_LE(progress.fraction, 1);
    fraction = progress.fraction;
  }
  EXPECT_EQ(points, mesher->Points());
  std::set<std::vector<std::uint32_t>> last;
  each(mesher->Simplices(), [&](const auto& s) { last.insert(s); });
  EXPECT_EQ(simplices, last);
  EXPECT_EQ(mesher->progress().phase, Phase::kDone);
  EXPECT_EQ(fraction, 1);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Determinism,
                         ::testing::Values(RepeatedCase{"circle:10", 0.2},
                                           RepeatedCase{"torus", 0.2},
                                           RepeatedCase{"torus", 0.3, true},
                                           RepeatedCase{"rp2", 0.4}, RepeatedCase{"so3", 0.8},
                                           RepeatedCase{"flat-torus:3", 0.7, true}));

// A mesh that is made twice as fine, or moved, or measured in other units, is as good.

// The manifold scaled and moved: y = scale * x + shift.
class Moved final : public Oracle {
 public:
  Moved(Oracle& inner, double scale, Eigen::VectorXd shift)
      : inner_(inner), scale_(scale), shift_(std::move(shift)) {}

  int dimension() const override { return inner_.dimension(); }
  int ambient_dimension() const override { return inner_.ambient_dimension(); }
  bool has_intersect_flat() const override { return true; }
  bool has_tangent_basis() const override { return true; }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return Out(inner_.ClosestPoint(In(x))); }
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    return Out(inner_.IntersectFlat(In(centers), bases, radii / scale_));
  }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return inner_.TangentBasis(In(points));
  }
  std::optional<stellate::BoundingBox> bounding_box() const override {
    const auto box = *inner_.bounding_box();
    return stellate::BoundingBox{scale_ * box.lower + shift_, scale_ * box.upper + shift_};
  }

 private:
  Eigen::MatrixXd In(const Eigen::MatrixXd& x) const { return (x.colwise() - shift_) / scale_; }
  Answer Out(Answer answer) const {
    answer.points = (scale_ * answer.points).colwise() + shift_;
    return answer;
  }

  Oracle& inner_;
  double scale_;
  Eigen::VectorXd shift_;
};

struct Motion {
  double scale, shift;
};

void PrintTo(const Motion& m, std::ostream* out) {
  *out << "scale " << m.scale << " shift " << m.shift;
}

class Invariance : public ::testing::TestWithParam<Motion> {};

TEST_P(Invariance, UnitsAndPlaceDoNotMatter) {
  for (const char* name : {"torus", "so3"}) {
    const auto manifold = Make(name);
    const double epsilon = manifold->dimension() == 3 ? 0.8 : 0.2;
    const auto [scale, shift] = GetParam();
    const Eigen::VectorXd by = Eigen::VectorXd::Constant(manifold->ambient_dimension(), shift);
    Moved moved(*manifold, scale, by);
    const DrivenRun run = Drive(SpecificationFor(moved, scale * epsilon), moved);
    testing::ExpectGoodMesh(run, manifold->facts());
    const DrivenRun plain = Drive(SpecificationFor(*manifold, epsilon), *manifold);
    const double ratio = static_cast<double>(run.report().counts.vertices) /
                         static_cast<double>(plain.report().counts.vertices);
    EXPECT_NEAR(ratio, 1, 0.1);
  }
}

INSTANTIATE_TEST_SUITE_P(Motions, Invariance,
                         ::testing::Values(Motion{1e-6, 0}, Motion{1e6, 0}, Motion{1, 1e4},
                                           Motion{1, 1e6}, Motion{1e-6, -1e-2}, Motion{1e6, 1e9}));

}  // namespace
}  // namespace stellate::core
