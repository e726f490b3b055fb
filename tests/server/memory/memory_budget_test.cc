#include "server/memory/memory_budget.h"

#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "core/base/message.h"
#include "server/memory/machine.h"
#include "tests/server/support/sphere.h"

namespace stellate::server {
namespace {

std::shared_ptr<MemoryBudget> Budget(std::uint64_t server, std::uint64_t owner) {
  return std::make_shared<MemoryBudget>(MemoryBudget::Limits{server, owner});
}

TEST(MemoryBudget, SumsWhatItsAccountsHold) {
  const auto budget = Budget(100, 0);
  auto a = MemoryBudget::Open(budget, "");
  const auto b = MemoryBudget::Open(budget, "");
  EXPECT_FALSE(a->Set(60));
  EXPECT_FALSE(b->Set(40));
  EXPECT_EQ(budget->total(), 100u);
  const auto refused = b->Set(41);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, core::StatusCode::kLimitExceeded);
  ASSERT_TRUE(refused->limit);
  EXPECT_EQ(refused->limit->setting, "max-memory-bytes");
  EXPECT_EQ(refused->limit->value, "100");
  EXPECT_EQ(refused->limit->scope, "server");
  EXPECT_NE(refused->message.find("--max-memory-bytes"), std::string::npos);
  EXPECT_EQ(b->bytes(), 40u) << "as before";
  EXPECT_FALSE(a->Set(59));
  EXPECT_FALSE(b->Set(41));
  a.reset();
  EXPECT_EQ(budget->total(), 41u);
}

TEST(MemoryBudget, HoldsEachNamedOwnerToItsShare) {
  const auto budget = Budget(100, 30);
  const auto alice = MemoryBudget::Open(budget, "alice");
  const auto alice_too = MemoryBudget::Open(budget, "alice");
  const auto bob = MemoryBudget::Open(budget, "bob");
  const auto nobody = MemoryBudget::Open(budget, "");
  EXPECT_FALSE(alice->Set(20));
  const auto refused = alice_too->Set(11);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->limit->setting, "owner-memory-bytes");
  EXPECT_EQ(refused->limit->value, "30");
  EXPECT_EQ(refused->limit->scope, "owner");
  EXPECT_EQ(refused->message.find("alice"), std::string::npos);
  EXPECT_FALSE(bob->Set(30));
  EXPECT_FALSE(nobody->Set(40)) << "where nobody is told apart, the server's limit is all";
}

TEST(MemoryBudget, WhatIsThereAlreadyIsCountedAllTheSame) {
  const auto budget = Budget(100, 0);
  const auto account = MemoryBudget::Open(budget, "");
  account->SetUnchecked(150);
  EXPECT_EQ(budget->total(), 150u);
  EXPECT_TRUE(account->Set(151));
  EXPECT_FALSE(account->Set(140)) << "it shrinks";
}

TEST(MemoryBudget, ThreadsKeepItsSum) {
  const auto budget = Budget(1000, 0);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&budget] {
      const auto account = MemoryBudget::Open(budget, "someone");
      for (std::uint64_t i = 0; i < 10'000; ++i) {
        account->Set(i % 400);
        EXPECT_LE(budget->total(), 1000u);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(budget->total(), 0u);
}

TEST(MemoryBudget, EstimatesGrowWithTheMeshAndTheRound) {
  core::Specification spec = testing::SphereSpec(0.1);
  const std::uint64_t empty = EstimateMeshBytes(spec, 0, 0);
  const std::uint64_t mesh = EstimateMeshBytes(spec, 100'000, 0);
  EXPECT_GT(mesh, empty + 100'000 * 3 * sizeof(double));
  EXPECT_GT(EstimateMeshBytes(spec, 100'000, 1000), mesh);
  spec.ambient_dimension = 100;
  EXPECT_GT(EstimateMeshBytes(spec, 100'000, 0), 2 * mesh);
}

// As `tests/bench/run memory` measured them: bytes a vertex of a mesh with its history.
TEST(MemoryBudget, EstimatesAreWhatWasMeasured) {
  struct Measured {
    int k, d;
    std::uint64_t vertices;
    double bytes;
  };
  for (const auto& [k, d, vertices, bytes] :
       {Measured{1, 2, 108'007, 489}, Measured{1, 20, 32'430, 1243}, Measured{2, 3, 155'669, 531},
        Measured{2, 20, 25'234, 1527}, Measured{2, 100, 3602, 5753}, Measured{3, 4, 10'962, 4178},
        Measured{3, 6, 22'701, 4652}, Measured{3, 9, 13'431, 5656}}) {
    core::Specification spec;
    spec.dimension = k;
    spec.ambient_dimension = d;
    const double share =
        static_cast<double>(EstimateMeshBytes(spec, vertices, 0) - EstimateMeshBytes(spec, 0, 0)) /
        (static_cast<double>(vertices) * bytes);
    EXPECT_GE(share, 0.8) << "k " << k << ", d " << d;
    EXPECT_LE(share, 1.5) << "k " << k << ", d " << d;
  }
}

// The peak beside the points that came, of uniform samples of 15,000 to 1,000,000 points.
TEST(MemoryBudget, EstimatesOfReconstructionsCoverWhatWasMeasured) {
  struct Measured {
    int k, d;
    core::Weighting weights;
    double bytes;
  };
  constexpr auto kAuto = core::Weighting::kAuto, kOnly = core::Weighting::kOnly;
  for (const auto& [k, d, weights, bytes] :
       {Measured{1, 3, kAuto, 523}, Measured{1, 3, kOnly, 639}, Measured{2, 3, kAuto, 648},
        Measured{2, 4, kAuto, 613}, Measured{2, 3, kOnly, 1272}, Measured{2, 1000, kAuto, 71'812},
        Measured{3, 4, kAuto, 4879}, Measured{3, 6, kAuto, 5399}, Measured{3, 9, kAuto, 6250},
        Measured{3, 9, kOnly, 5561}}) {
    core::ReconstructionSpecification spec;
    spec.dimension = k;
    spec.ambient_dimension = d;
    spec.weights = weights;
    constexpr std::uint64_t kPoints = 1'000'000;
    const double estimate =
        static_cast<double>(EstimateReconstructionBytes(spec, kPoints)) / double{kPoints};
    EXPECT_GE(estimate, bytes) << core::Message(k, " in R^", d);
    EXPECT_LE(estimate, 2.5 * bytes) << core::Message(k, " in R^", d);
  }
}

TEST(MemoryBudget, SeedsAreCountedEvenOfWhatIsFinished) {
  core::Specification spec = testing::SphereSpec(0.1);
  const std::uint64_t few = EstimateFinishedBytes(spec);
  spec.seeds = Eigen::MatrixXd::Zero(3, 100'000);
  EXPECT_GE(EstimateFinishedBytes(spec), few + 2 * 100'000 * 3 * sizeof(double));
  EXPECT_GE(EstimateStreamBytes(spec, 0), 2 * 100'000 * 3 * sizeof(double)) << "they are sent";
}

TEST(MemoryBudget, OpenCallsHaveAnEighth) {
  constexpr std::uint64_t kMebi = std::uint64_t{1} << 20;
  const auto streams = std::make_shared<MemoryBudget>(MemoryBudget::Limits{80 * kMebi, 64 * kMebi},
                                                      MemoryBudget::Of::kStreams);
  const auto alice = MemoryBudget::Open(streams, "alice");
  EXPECT_FALSE(alice->Set(8 * kMebi));
  const auto more = MemoryBudget::Open(streams, "alice");
  const auto refused = more->Set(1);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->limit->setting, "owner-memory-bytes");
  EXPECT_EQ(refused->limit->value, core::Message(64 * kMebi));
  EXPECT_NE(refused->message.find("allows each owner 8388608"), std::string::npos)
      << refused->message;
  const auto bob = MemoryBudget::Open(streams, "bob");
  EXPECT_EQ(bob->Set(3 * kMebi)->limit->setting, "max-memory-bytes");
  EXPECT_FALSE(bob->Set(2 * kMebi));
}

TEST(MemoryBudget, LimitsMayChangeWhileItIsHeld) {
  const auto budget = std::make_shared<MemoryBudget>(MemoryBudget::Limits{100, 80});
  const auto alice = MemoryBudget::Open(budget, "alice");
  EXPECT_FALSE(alice->Set(60));
  budget->SetLimits({40, 30});
  EXPECT_EQ(alice->bytes(), 60u) << "what is held stays held";
  EXPECT_EQ(alice->Set(61)->limit->value, "40");
  EXPECT_FALSE(alice->Set(35)) << "less is always allowed";
  EXPECT_EQ(alice->Set(36)->limit->setting, "owner-memory-bytes");
  budget->SetLimits({200, 100});
  EXPECT_FALSE(alice->Set(100));
}

TEST(MemoryBudget, TheMachineIsMeasured) {
  EXPECT_GT(ResidentBytes(), std::uint64_t{1} << 20);
  EXPECT_GT(MachineBytes(), ResidentBytes());
}

}  // namespace
}  // namespace stellate::server
