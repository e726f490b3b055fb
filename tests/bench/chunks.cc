// How a round's queries are shared out, without a server, an oracle or a wait: the dispatcher under
// a clock that is a number, with the rounds of a real torus. The time of chunks/ is that clock's.
//
// A worker answers one chunk after another, after a fixed cost and a time for each query, and the
// answers travel. Efficiency is queries times the time of one, over workers times the time of all.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "server/oracles/dispatch.h"
#include "tests/bench/timings.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

namespace stellate::bench {
namespace {

using namespace std::chrono_literals;
using namespace stellate::server;
constexpr double kBegin = 1;  // seconds: time zero is no time
using benchmark::State;
using Rounds = std::vector<std::vector<Dispatch::Block>>;

// Seconds, except the count.
struct Workers {
  int count = 1;
  double per_query = 0;
  double fixed = 0;   // of a chunk, while which the worker does nothing else
  double trip = 0;    // there and back, while which it does
  double spread = 0;  // of a query's time: its logarithm's standard deviation
};

struct Result {
  double seconds = 0;
  double efficiency = 0;
  std::size_t chunks = 0;
  long queries = 0;
};

// The blocks of queries of each round.
Rounds RoundsOf(const Work& work) {
  const auto oracle = testing::Make(work.manifold);
  auto mesher = core::Mesher::Create(testing::SpecificationFor(*oracle, work.epsilon));
  Rounds rounds;
  while (const auto batch = (*mesher)->NextBatch()) {
    auto& blocks = rounds.emplace_back();
    const auto d = static_cast<std::size_t>(oracle->ambient_dimension());
    const std::size_t bytes = 8 * d * static_cast<std::size_t>(1 + oracle->dimension()) + 9;
    for (const auto& block : batch->blocks) blocks.push_back({block.size(), bytes});
    (void)(*mesher)->Absorb(testing::AnswersOf(*oracle, *batch));
  }
  return rounds;
}

double FactorOf(const Workers& workers, std::mt19937_64* random) {
  if (workers.spread == 0) return 1;
  return std::lognormal_distribution<double>(-workers.spread * workers.spread / 2,
                                             workers.spread)(*random);
}

class Simulation {
 public:
  Simulation(const Workers& workers, std::uint64_t seed)
      : workers_(workers), random_(seed), dispatch_({}) {
    for (int i = 1; i <= workers.count; ++i) dispatch_.Join(static_cast<WorkerId>(i), 0);
    free_at_.assign(static_cast<std::size_t>(workers.count) + 1, kBegin);
  }

  Result Run(const Rounds& rounds) {
    for (const auto& blocks : rounds) {
      dispatch_.Begin(blocks, Time());
      for (const auto& block : blocks) result_.queries += block.queries;
      Give();
      while (!dispatch_.Done(Time())) Step();
      dispatch_.End();
      given_.clear();
    }
    result_.seconds = std::max(now_ - kBegin, 1e-9);
    result_.efficiency = static_cast<double>(result_.queries) * workers_.per_query /
                         (result_.seconds * workers_.count);
    return result_;
  }

 private:
  TimePoint Time() const {
    return TimePoint{} +
           std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(now_));
  }

  // To the next answer, or the dispatcher's own deadline.
  void Step() {
    const double deadline =
        std::chrono::duration<double>(dispatch_.NextDeadline().time_since_epoch()).count();
    if (!answers_.empty() && answers_.begin()->first <= deadline) {
      now_ = std::max(now_, answers_.begin()->first);
      const Lease lease = answers_.begin()->second;
      answers_.erase(answers_.begin());
      Lease claimed;
      const auto result = dispatch_.Accept(lease.worker, lease.id, Time(), &claimed);
      if (result == Dispatch::AcceptResult::kCounts)
        dispatch_.MarkAnswered(claimed.id, claimed.count);
      if (result == Dispatch::AcceptResult::kForComparison) Compare(claimed);
    } else {
      now_ = std::max(now_, deadline) + 1e-9;
      dispatch_.Expire(Time());
    }
    Give();
  }

  void Compare(const Lease& second) {
    for (const Lease& first : given_) {
      const bool same = first.block == second.block && first.first <= second.first &&
                        second.first < first.first + first.count;
      if (same) dispatch_.Compared(first.worker, second.worker, second.block);
    }
  }

  void Give() {
    for (const Lease& lease : dispatch_.Assign(Time())) {
      if (!lease.check) given_.push_back(lease);
      double work = workers_.fixed;
      for (Eigen::Index i = 0; i < lease.count && workers_.spread > 0; ++i) {
        work += workers_.per_query * FactorOf(workers_, &random_);
      }
      if (workers_.spread == 0) work += workers_.per_query * static_cast<double>(lease.count);
      double& free = free_at_[lease.worker];
      free = std::max(free, now_ + workers_.trip / 2) + work;
      answers_.emplace(free + workers_.trip / 2, lease);
      ++result_.chunks;
    }
  }

  const Workers workers_;
  std::mt19937_64 random_;
  Dispatch dispatch_;
  double now_ = kBegin;
  std::vector<double> free_at_;
  std::vector<Lease> given_;              // of the round, without checks
  std::multimap<double, Lease> answers_;  // by when they come
  Result result_;
};

// Each query to whoever is free first, for nothing: no way of sharing out unknown work does better.
double Bound(const Rounds& rounds, const Workers& workers, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  double seconds = 0, queries = 0;
  for (const auto& blocks : rounds) {
    std::multiset<double> free;
    for (int i = 0; i < workers.count; ++i) free.insert(0);
    for (const auto& block : blocks) {
      queries += static_cast<double>(block.queries);
      for (Eigen::Index i = 0; i < block.queries; ++i) {
        const double begin = *free.begin();
        free.erase(free.begin());
        free.insert(begin + workers.per_query * FactorOf(workers, &random));
      }
    }
    seconds += *free.rbegin();
  }
  return queries * workers.per_query / (seconds * workers.count);
}

// The rounds of a mesh, which is made when the first benchmark asks for it.
class LazyRounds {
 public:
  explicit LazyRounds(Work work) : work_(std::move(work)) {}
  const Rounds& operator()() {
    if (rounds_.empty()) rounds_ = RoundsOf(work_);
    return rounds_;
  }

 private:
  const Work work_;
  Rounds rounds_;
};
using SharedRounds = std::shared_ptr<LazyRounds>;

// "10 ms" and so on, in a name.
std::string In(const char* what, double value) {
  char text[60];
  std::snprintf(text, sizeof(text), "/%s:%g", what, value);
  return text;
}

// The mean of `seeds` simulations.
void Register(const std::string& name, const SharedRounds& rounds, const Workers& workers,
              std::uint64_t seeds = 1) {
  const auto run = [=](State& state) {
    for ([[maybe_unused]] auto _ : state) {
      Result sum{0, 0, 0, 0};
      for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        const Result one = Simulation(workers, seed).Run((*rounds)());
        sum.seconds += one.seconds;
        sum.efficiency += one.efficiency;
        sum.chunks += one.chunks;
      }
      const auto n = static_cast<double>(seeds);
      state.SetIterationTime(sum.seconds / n);
      state.counters["chunks"] = static_cast<double>(sum.chunks) / n;
      state.counters["efficiency"] = sum.efficiency / n;
    }
  };
  benchmark::RegisterBenchmark(("chunks/" + name).c_str(), run)
      ->Iterations(1)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

// One worker, by the fixed cost of a chunk; and by time on the way, while it works.
void RegisterFixedCosts(const SharedRounds& rounds, double per_query) {
  const std::string name = "one_worker" + In("query_ms", 1000 * per_query);
  for (const double fixed : {0.0, 0.02, 0.1, 0.125, 0.15, 0.2, 0.25, 0.5, 2.0})
    Register(name + In("fixed_ms", 1000 * fixed), rounds, {1, per_query, fixed, 0.0002, 0});
  for (const double trip : {0.1, 0.25, 0.5})
    Register(name + In("trip_ms", 1000 * trip), rounds, {1, per_query, 0, trip, 0});
}

// Queries that differ by e^spread, by the time of a query, fixed cost and workers; then as good as
// it gets.
void RegisterEfficiencies(const SharedRounds& rounds, double spread) {
  constexpr std::uint64_t kSeeds = 5;
  constexpr int kWorkers[] = {1, 4, 8, 32, 100};
  const std::string name = "efficiency" + In("spread", spread);
  for (const double per_query : {0.001, 0.02, 0.1, 2.0})
    for (const double fixed : {0.0, 0.02, 0.1, 0.5})
      for (const int workers : kWorkers)
        Register(name + In("query_ms", 1000 * per_query) + In("fixed_ms", 1000 * fixed) +
                     In("workers", workers),
                 rounds, {workers, per_query, fixed, 0.001, spread}, kSeeds);
  for (const int workers : kWorkers) {
    const auto bound = [=](State& state) {
      for ([[maybe_unused]] auto _ : state) {
        double sum = 0;
        for (std::uint64_t seed = 1; seed <= kSeeds; ++seed)
          sum += Bound((*rounds)(), {workers, 1, 0, 0, spread}, seed);
        state.counters["efficiency"] = sum / kSeeds;
      }
    };
    benchmark::RegisterBenchmark(("chunks/" + name + "/best" + In("workers", workers)).c_str(),
                                 bound)
        ->Iterations(1);
  }
}

// What a fast oracle pays beyond its own time: trips of 0.2 ms, waits, chunks.
void RegisterFastOracles(const SharedRounds& rounds) {
  for (const double per_query : {1e-7, 1e-6, 1e-5, 1e-4})
    for (const int workers : {1, 2, 4, 16})
      Register("fast" + In("query_us", 1e6 * per_query) + In("workers", workers), rounds,
               {workers, per_query, 0.00003, 0.0002, 0});
}

}  // namespace

void RegisterChunks(const std::vector<Work>& asked) {
  const auto rounds = [&](double epsilon) {
    return std::make_shared<LazyRounds>(asked.empty() ? Work{"torus:1:0.4", epsilon} : asked[0]);
  };
  const SharedRounds coarse = rounds(0.2), medium = rounds(0.1), fine = rounds(0.02);
  RegisterFixedCosts(medium, 0);
  RegisterFixedCosts(medium, 0.001);
  RegisterEfficiencies(coarse, 0);
  RegisterEfficiencies(coarse, 1);
  RegisterFastOracles(fine);
}

}  // namespace stellate::bench
