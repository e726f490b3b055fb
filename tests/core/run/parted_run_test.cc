// A mesh is a function of specification and answers alone, however many parts refine it, and
// whatever lies in which of them.

#include "tests/core/support/parted_run.h"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string>
#include <vector>

namespace stellate::core {
namespace {

using testing::Cubes;
using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::PartedRun;
using testing::SpecificationFor;

template <int K>
using Simplices = std::set<std::array<std::uint32_t, K + 1>>;

template <int K>
Simplices<K> SetOf(const std::vector<std::uint32_t>& ids) {
  Simplices<K> simplices;
  for (std::size_t i = 0; i < ids.size(); i += K + 1) {
    std::array<std::uint32_t, K + 1> simplex;
    std::copy_n(ids.begin() + static_cast<std::ptrdiff_t>(i), K + 1, simplex.begin());
    EXPECT_TRUE(simplices.insert(simplex).second) << "two parts hold one simplex";
  }
  return simplices;
}

struct PartedCase {
  std::string manifold;
  double epsilon;
  double halo;  // in epsilon: what the stars of the stars around a part's own ones hang on
  double edge;  // of Cubes, length
  int along;    // see there
};

template <int K>
class Whole {
 public:
  explicit Whole(const PartedCase& it)
      : case_(it),
        manifold_(Make(it.manifold)),
        spec_(SpecificationFor(*manifold_, it.epsilon)),
        run_(Drive(spec_, *manifold_)) {
    EXPECT_TRUE(run_.report().certificate.certified) << run_.report().certificate.verdict;
    while (run_.deltas[sampled_].added.empty()) ++sampled_;
  }

  // Returns the rules that it took.
  std::set<Rule> ExpectSameIn(int parts) const {
    const double halo = case_.halo * case_.epsilon;
    PartedRun<K> parted(spec_, *manifold_, Cubes(parts, case_.edge, case_.along), halo);
    const MeshDelta& last = run_.deltas[sampled_];
    const auto count = static_cast<Eigen::Index>(last.first_vertex) + last.points.cols();
    parted.Lay(run_.mesher->Points().leftCols(count), Bases(count));
    parted.Refine(sampled_ + 1, [&](std::uint64_t round, const auto& added, const auto& removed) {
      ASSERT_LE(round, run_.deltas.size());
      const MeshDelta& whole = run_.deltas[round - 1];
      EXPECT_EQ(SetOf<K>(added), SetOf<K>(whole.added)) << "added in round " << round;
      EXPECT_EQ(SetOf<K>(removed), SetOf<K>(whole.removed)) << "removed in round " << round;
    });
    const Eigen::MatrixXd points = run_.mesher->Points();
    EXPECT_EQ(parted.PointsByName(),
              std::vector<double>(points.data(), points.data() + points.size()));
    EXPECT_EQ(SetOf<K>(parted.Simplices()), SetOf<K>(run_.mesher->Simplices()));
    EXPECT_GT(parted.size(), count);
    EXPECT_LE(parted.share_of_own(), 1);
    return parted.rules();
  }

 private:
  Eigen::MatrixXd Bases(Eigen::Index count) const {
    const Eigen::MatrixXd all = run_.mesher->Tangents();
    Eigen::MatrixXd rows(all.rows(), count);
    for (Eigen::Index c = 0; c < count; ++c)
      ToByVector(all.col(c).data(), spec_.ambient_dimension, K, rows.col(c).data());
    return rows;
  }

  const PartedCase case_;
  const std::unique_ptr<Manifold> manifold_;
  const Specification spec_;
  const DrivenRun run_;
  std::size_t sampled_ = 0;  // the delta with the first stars
};

template <int K>
std::set<Rule> ExpectSameInParts(const PartedCase& it) {
  const Whole<K> whole(it);
  std::set<Rule> rules;
  for (const int parts : {1, 2, 3, 7}) {
    SCOPED_TRACE(it.manifold + " in " + std::to_string(parts));
    rules.merge(whole.ExpectSameIn(parts));
    if (::testing::Test::HasFailure()) break;
  }
  return rules;
}

TEST(PartedRun, OfASurfaceIsTheMesh) {
  EXPECT_TRUE(ExpectSameInParts<2>({"torus:1:0.4", 0.03, 5, 0.4, 2}).contains(Rule::kSize));
}

TEST(PartedRun, InThreeDimensionsIsTheMesh) {
  EXPECT_TRUE(ExpectSameInParts<3>({"flat-torus:3", 0.25, 5, 1.25, 2}).contains(Rule::kShape));
}

}  // namespace
}  // namespace stellate::core
