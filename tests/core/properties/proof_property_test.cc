// What is proved is true, for declared reaches that are true, too small and too large.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <iostream>
#include <iterator>
#include <string>

#include "core/base/random.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/trials.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ForEachTrial;
using testing::Make;
using testing::SpecificationFor;
using testing::TopologyOf;

double Between(Random& random, double low, double high) {
  return low + (high - low) * random.Uniform();
}

std::string AnyManifold(Random& random) {
  const auto number = [&](double low, double high) {
    return std::to_string(Between(random, low, high));
  };
  switch (random.Next() % 10) {
    case 0:
      return "circle:" + std::to_string(2 + random.Next() % 8);
    case 1:
      return "sphere:2:" + std::to_string(3 + random.Next() % 4);
    case 2:
      return "torus:1:" + number(0.15, 0.85);
    case 3:
      return "ellipsoid:1:" + number(0.5, 1) + ":" + number(0.5, 1);
    case 4:
      return "circles:1:" + number(0.3, 1);
    case 5:
      return "two-spheres";
    case 6:
      return "rp2";
    case 7:
      return "clifford-torus@" + std::to_string(4 + random.Next() % 6);
    case 8:
      return "sphere:3:4";
    default:
      return "flat-torus:3";
  }
}

// Of the reach that is declared: true, too small, too large.
constexpr double kShares[] = {1, 0.6, 1.5, 3, 10};

struct Tally {
  int proved = 0, sampled = 0, refuted = 0, refused = 0;
};

std::ostream& operator<<(std::ostream& out, const Tally& t) {
  return out << t.proved << " proved, " << t.sampled << " certified without, " << t.refuted
             << " refuted, " << t.refused << " refused otherwise";
}

// ... in any case: of the mesh itself, too, where the declared reach is too large for the theorem.
void ExpectTrue(const DrivenRun& run, Manifold& manifold, double share) {
  const testing::Topology topology = TopologyOf(run.mesher->Simplices(), manifold.dimension());
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.euler_characteristic, manifold.facts().euler_characteristic);
  EXPECT_EQ(topology.components, static_cast<std::uint64_t>(manifold.facts().betti_mod2.front()));
  if (share > 1) return;
  // Points of simplices, drawn anew.
  const Eigen::MatrixXd points = run.mesher->Points();
  const std::vector<std::uint32_t> ids = run.mesher->Simplices();
  const int k = manifold.dimension();
  Random random(7);
  Eigen::MatrixXd drawn = Eigen::MatrixXd::Zero(points.rows(), 200);
  for (Eigen::Index i = 0; i < drawn.cols(); ++i) {
    const std::size_t s = random.Next() % (ids.size() / (k + 1));
    double sum = 0;
    for (int c = 0; c <= k; ++c) {
      const double weight = -std::log(1 - random.Uniform());
      drawn.col(i) += weight * points.col(ids[s * (k + 1) + c]);
      sum += weight;
    }
    drawn.col(i) /= sum;
  }
  EXPECT_LE(manifold.Distance(drawn).maxCoeff(),
            run.report().certificate.proved_distance * (1 + 1e-9));
}

// STELLATE_PROPERTY_TRIALS of these, by property_campaign.
TEST(Proofs, AreNeverWrong) {
  Tally tallies[std::size(kShares)];
  ForEachTrial(20, [&](std::uint64_t seed) {
    Random random(seed, 0x70726f6f66);
    const auto manifold = Make(AnyManifold(random));
    const double reach = manifold->facts().reach.value();
    const std::size_t kind = random.Next() % std::size(kShares);
    const double share = kShares[kind];
    // Never far finer than the manifold needs, or trials take minutes.
    const double coarsest = manifold->dimension() >= 3 ? 0.5 : 0.2;
    Specification spec = SpecificationFor(*manifold, Between(random, coarsest, 1.2) * reach);
    spec.declared_reach = share * reach;
    spec.oracle.tangent_basis = random.Next() % 2 == 0;
    spec.oracle.intersect_flat = random.Next() % 2 == 0;
    spec.random_seed = seed;
    SCOPED_TRACE("epsilon " + std::to_string(spec.epsilon / reach) + " and declared " +
                 std::to_string(share) + " of the reach");
    const DrivenRun run = Drive(spec, *manifold);
    const Certificate& c = run.report().certificate;
    Tally& tally = tallies[kind];
    if (share <= 1) {
      EXPECT_FALSE(c.reach_refuted) << c.verdict;
    }
    switch (c.level) {
      case CertificateLevel::kProved:
        ++tally.proved;
        ExpectTrue(run, *manifold, share);
        break;
      case CertificateLevel::kSampled:
        ++tally.sampled;
        break;
      case CertificateLevel::kDecided:
        ADD_FAILURE() << "a level of reconstructions alone";
        break;
      case CertificateLevel::kRefused:
        ++(c.reach_refuted ? tally.refuted : tally.refused);
        break;
    }
  });
  for (std::size_t i = 0; i < std::size(kShares); ++i) {
    std::cout << "declared " << kShares[i] << " of the reach: " << tallies[i] << "\n";
    if (kShares[i] <= 1) {
      EXPECT_GE(tallies[i].proved, tallies[i].sampled + tallies[i].refused);
    }
  }
}

}  // namespace
}  // namespace stellate::core
