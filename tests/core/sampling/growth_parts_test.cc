// A sample is the same, bit for bit, however many parts grow it, and whatever lies in which of
// them.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/base/basis_layout.h"
#include "core/base/random.h"
#include "core/sampling/growth.h"
#include "core/sampling/sampler.h"
#include "tests/core/support/samples.h"
#include "tests/core/support/thread_peers.h"

namespace stellate::core {
namespace {

using testing::Make;
using testing::ThreadPeers;

struct Reply {
  Eigen::MatrixXd points, tangents;
  std::vector<std::uint8_t> found;
};

Reply ReplyTo(Manifold& manifold, const Eigen::MatrixXd& x) {
  const int d = manifold.ambient_dimension(), k = manifold.dimension();
  const Answer answer = manifold.ClosestPoint(x);
  const Eigen::MatrixXd bases =
      answer.tangents.size() ? answer.tangents : manifold.TangentBasis(answer.points);
  Reply all{answer.points, Eigen::MatrixXd(d * k, x.cols()),
            std::vector<std::uint8_t>(static_cast<std::size_t>(x.cols()), 1)};
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    ToByVector(bases.col(c).data(), d, k, all.tangents.col(c).data());
  return all;
}

Eigen::MatrixXd RandomInBox(Manifold& manifold, Eigen::Index count, std::uint64_t seed) {
  const auto box = *manifold.bounding_box();
  Random random(seed);
  Eigen::MatrixXd x(manifold.ambient_dimension(), count);
  for (double& at : x.reshaped()) at = static_cast<double>(random.Next() >> 11) * 0x1p-53;
  return (x.array().colwise() * (box.upper - box.lower).array()).colwise() + box.lower.array();
}

// Of one ring, a column each: what was asked, with the tangent bases, and what joined.
struct AskedRing {
  std::vector<std::vector<double>> asked, joined;
};

// The same in any order.
void Sort(std::vector<AskedRing>* rings) {
  for (AskedRing& ring : *rings) {
    std::sort(ring.asked.begin(), ring.asked.end());
    std::sort(ring.joined.begin(), ring.joined.end());
  }
}

// Grows from `begun`, and then from those of `seeds` that nothing has come near.
template <int K>
std::vector<AskedRing> GrowInRings(Growth<K>* growth, Manifold& manifold, const Reply& begun,
                                   const Reply& seeds, const Peers& peers) {
  std::vector<AskedRing> rings;
  growth->Begin(begun.points, begun.tangents, begun.found, 0);
  for (int left = 1; left >= 0; --left) {
    while (true) {
      const auto ring = growth->Propose();
      if (peers.Sum(static_cast<std::uint64_t>(ring.points.cols())).all == 0) break;
      const Reply answered = ReplyTo(manifold, ring.points);
      AskedRing& it = rings.emplace_back();
      for (Eigen::Index c = 0; c < ring.points.cols(); ++c) {
        it.asked.emplace_back(ring.points.col(c).begin(), ring.points.col(c).end());
        it.asked.back().insert(it.asked.back().end(), ring.tangents.col(c).begin(),
                               ring.tangents.col(c).end());
      }
      for (const Eigen::Index c : growth->Join(answered.points, answered.tangents, answered.found))
        it.joined.emplace_back(answered.points.col(c).begin(), answered.points.col(c).end());
    }
    if (left > 0)
      growth->Begin(seeds.points, seeds.tangents, seeds.found, kPatchesApart * growth->spacing());
  }
  return rings;
}

// The coarse lattice that a sample grows from.
template <int K>
Reply Scout(Manifold& manifold, double spacing, const Reply& seeds) {
  Growth<K> scouting(manifold.ambient_dimension(), kPatchesApart * spacing);
  std::vector<Reply> found;
  std::vector<std::vector<Eigen::Index>> columns;
  found.push_back(seeds);
  columns.push_back(scouting.Begin(seeds.points, seeds.tangents, seeds.found, scouting.spacing()));
  for (auto ring = scouting.Propose(); ring.points.cols() > 0; ring = scouting.Propose()) {
    found.push_back(ReplyTo(manifold, ring.points));
    columns.push_back(
        scouting.Join(found.back().points, found.back().tangents, found.back().found));
  }
  Reply all;
  all.points.resize(seeds.points.rows(), scouting.size());
  all.tangents.resize(seeds.tangents.rows(), scouting.size());
  all.found.assign(scouting.size(), 1);
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    for (const Eigen::Index c : columns[i]) {
      all.points.col(at) = found[i].points.col(c);
      all.tangents.col(at++) = found[i].tangents.col(c);
    }
  return all;
}

struct GrownCase {
  std::string manifold;
  double epsilon;
};

template <int K>
class GrownSample {
 public:
  explicit GrownSample(const GrownCase& it)
      : case_(it),
        manifold_(Make(it.manifold)),
        d_(manifold_->ambient_dimension()),
        spacing_(SampleSpacing(K, it.epsilon)),
        seeds_(ReplyTo(*manifold_, RandomInBox(*manifold_, 100, 5))),
        scouts_(Scout<K>(*manifold_, spacing_, seeds_)) {
    Growth<K> whole(d_, spacing_);
    rings_ = GrowInRings<K>(&whole, *manifold_, scouts_, seeds_, Alone());
    laid_ = whole.size();
    Sort(&rings_);
    EXPECT_GT(laid_, 500u);
  }

  void ExpectSameIn(int parts, const Boxes& boxes) {
    SCOPED_TRACE(case_.manifold + " in " + std::to_string(parts));
    ThreadPeers all(parts);
    std::vector<std::vector<AskedRing>> rings(static_cast<std::size_t>(parts));
    known_.assign(rings.size(), 0);
    all.Run([&](const Peers& peers) {
      const auto part = static_cast<std::size_t>(peers.part());
      const auto manifold = Make(case_.manifold);
      Growth<K> growth(d_, spacing_, false, Territory(peers, boxes));
      rings[part] = GrowInRings<K>(&growth, *manifold, scouts_, seeds_, peers);
      known_[part] = growth.size();
    });
    std::vector<AskedRing> together(rings.front().size());
    for (const auto& its : rings) {
      ASSERT_EQ(its.size(), together.size());
      for (std::size_t r = 0; r < its.size(); ++r) {
        auto& [asked, joined] = together[r];
        asked.insert(asked.end(), its[r].asked.begin(), its[r].asked.end());
        joined.insert(joined.end(), its[r].joined.begin(), its[r].joined.end());
      }
    }
    Sort(&together);
    ASSERT_EQ(together.size(), rings_.size());
    for (std::size_t r = 0; r < rings_.size(); ++r) {
      ASSERT_TRUE(together[r].asked == rings_[r].asked) << "asked in ring " << r;
      ASSERT_TRUE(together[r].joined == rings_[r].joined) << "joined in ring " << r;
    }
  }

  // Boxes of equally many scouts, and any.
  void ExpectSame() {
    for (const int parts : {1, 2, 3, 5, 8}) {
      ExpectSameIn(parts, Fitted(parts));
      ExpectSameIn(parts, Any(parts));
      if (::testing::Test::HasFailure()) return;
    }
  }

  Boxes Fitted(int parts) const {
    return {std::span(scouts_.points.data(), static_cast<std::size_t>(scouts_.points.size())), d_,
            parts};
  }
  Boxes Any(int parts) const {
    const Eigen::MatrixXd points = RandomInBox(*manifold_, parts, 9);
    return {std::span(points.data(), static_cast<std::size_t>(points.size())), d_, parts};
  }
  // How many points the part that knows most knows, of the whole's.
  double most_known() const {
    return static_cast<double>(*std::max_element(known_.begin(), known_.end())) / laid_;
  }

 private:
  const GrownCase case_;
  const std::unique_ptr<Manifold> manifold_;
  const int d_;
  const double spacing_;
  const Reply seeds_, scouts_;
  std::vector<AskedRing> rings_;
  std::uint32_t laid_ = 0;
  std::vector<std::uint32_t> known_;
};

TEST(GrowthInParts, OfCurvesIsTheWhole) {
  GrownSample<1>({"circle", 0.003}).ExpectSame();
  GrownSample<1>({"torus-knot:2:3", 0.01}).ExpectSame();
}

TEST(GrowthInParts, OfSurfacesIsTheWhole) {
  GrownSample<2>({"sphere:2", 0.05}).ExpectSame();
  GrownSample<2>({"torus:1:0.4", 0.03}).ExpectSame();
  GrownSample<2>({"tanglecube", 0.06}).ExpectSame();
  GrownSample<2>({"clifford-torus", 0.08}).ExpectSame();
  GrownSample<2>({"rp2", 0.04}).ExpectSame();
}

TEST(GrowthInParts, OfThreeManifoldsIsTheWhole) {
  GrownSample<3>({"sphere:3", 0.2}).ExpectSame();
  GrownSample<3>({"flat-torus:3", 0.4}).ExpectSame();
  GrownSample<3>({"so3", 0.2}).ExpectSame();
}

// A part holds what is its own, and little more.
TEST(GrowthInParts, IsHeldInParts) {
  GrownSample<2> torus({"torus:1:0.4", 0.012});
  torus.ExpectSameIn(2, torus.Fitted(2));
  EXPECT_LT(torus.most_known(), 1.15 / 2);
  torus.ExpectSameIn(8, torus.Fitted(8));
  EXPECT_LT(torus.most_known(), 1.5 / 8);
}

}  // namespace
}  // namespace stellate::core
