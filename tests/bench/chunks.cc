// How a round's queries are shared out, without a server, an oracle or a wait: the dispatcher under
// a clock that is a number, with the rounds of a real torus.
//
//   chunks [MANIFOLD EPSILON]
//
// A worker answers one chunk after another, after a fixed cost and a time for each query, and the
// answers travel. Efficiency is queries times the time of one, over workers times the time of all.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "server/oracles/dispatch.h"
#include "tests/support/run_mesher.h"

namespace {

using namespace std::chrono_literals;
using namespace stellate::server;
constexpr double kBegin = 1;  // seconds: time zero is no time
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

Rounds RoundsOf(const std::string& manifold, double epsilon) {
  std::string error;
  const auto oracle = stellate::MakeManifold(manifold, &error);
  if (oracle == nullptr) {
    std::fprintf(stderr, "%s\n", error.c_str());
    std::exit(2);
  }
  auto mesher =
      stellate::core::Mesher::Create(stellate::testing::SpecificationFor(*oracle, epsilon));
  Rounds rounds;
  while (const auto* batch = (*mesher)->NextBatch()) {
    auto& blocks = rounds.emplace_back();
    const auto d = static_cast<std::size_t>(oracle->ambient_dimension());
    const std::size_t bytes = 8 * d * static_cast<std::size_t>(1 + oracle->dimension()) + 9;
    for (const auto& block : batch->blocks) blocks.push_back({block.size(), bytes});
    (void)(*mesher)->Absorb(stellate::testing::AnswersOf(*oracle, *batch));
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

Result Simulate(const Rounds& rounds, const Workers& workers) {
  return Simulation(workers, 1).Run(rounds);
}

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

void FixedCosts(const Rounds& rounds, double per_query) {
  std::printf("\nOne worker, %g ms a query: seconds / chunks by the fixed cost of a chunk\n",
              1000 * per_query);
  for (const double fixed : {0.0, 0.02, 0.1, 0.125, 0.15, 0.2, 0.25, 0.5, 2.0}) {
    const Result result = Simulate(rounds, {1, per_query, fixed, 0.0002, 0});
    std::printf("  %4.0f ms %8.2f s %6zu\n", 1000 * fixed, result.seconds, result.chunks);
  }
  for (const double trip : {0.1, 0.25, 0.5}) {
    const Result result = Simulate(rounds, {1, per_query, 0, trip, 0});
    std::printf("  %4.0f ms %8.2f s %6zu   on the way, not at work\n", 1000 * trip, result.seconds,
                result.chunks);
  }
}

void Efficiencies(const Rounds& rounds, double spread) {
  constexpr std::uint64_t kSeeds = 5;
  constexpr int kWorkers[] = {1, 4, 8, 32, 100};
  std::printf(
      "\nEfficiency, queries that differ by e^%g: by time of a query, fixed cost, workers\n",
      spread);
  std::printf("%22s", "");
  for (const int workers : kWorkers) std::printf("%8d", workers);
  std::printf("\n");
  for (const double per_query : {0.001, 0.02, 0.1, 2.0}) {
    for (const double fixed : {0.0, 0.02, 0.1, 0.5}) {
      std::printf("  %7.0f ms, %4.0f ms  ", 1000 * per_query, 1000 * fixed);
      for (const int workers : kWorkers) {
        double sum = 0;
        for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
          sum +=
              Simulation({workers, per_query, fixed, 0.001, spread}, seed).Run(rounds).efficiency;
        }
        std::printf("%8.2f", sum / kSeeds);
      }
      std::printf("\n");
    }
  }
  std::printf("  as good as it gets  ");
  for (const int workers : kWorkers) {
    double sum = 0;
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      sum += Bound(rounds, {workers, 1, 0, 0, spread}, seed);
    }
    std::printf("%8.2f", sum / kSeeds);
  }
  std::printf("\n");
}

// What a fast oracle pays beyond its own time: trips, waits, chunks.
void FastOracles(const Rounds& rounds) {
  std::printf("\nFast oracles, a trip of 0.2 ms: milliseconds / chunks by workers\n");
  for (const double per_query : {1e-7, 1e-6, 1e-5, 1e-4}) {
    std::printf("  %5.1f us", 1e6 * per_query);
    for (const int workers : {1, 2, 4, 16}) {
      const Result result = Simulate(rounds, {workers, per_query, 0.00003, 0.0002, 0});
      std::printf("  %2d: %8.2f ms %6zu", workers, 1000 * result.seconds, result.chunks);
    }
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string manifold = argc > 2 ? argv[1] : "torus:1:0.4";
  for (const double epsilon : {0.2, 0.1, 0.02}) {
    const Rounds rounds = RoundsOf(manifold, argc > 2 ? std::atof(argv[2]) : epsilon);
    long queries = 0;
    for (const auto& blocks : rounds) {
      for (const auto& block : blocks) queries += block.queries;
    }
    std::printf("\n%s, epsilon %g: %ld queries in %zu rounds\n", manifold.c_str(),
                argc > 2 ? std::atof(argv[2]) : epsilon, queries, rounds.size());
    if (argc > 2 || epsilon == 0.1) {
      FixedCosts(rounds, 0);
      FixedCosts(rounds, 0.001);
    }
    if (argc > 2 || epsilon == 0.2) {
      Efficiencies(rounds, 0);
      Efficiencies(rounds, 1);
    }
    if (argc > 2 || epsilon == 0.02) FastOracles(rounds);
    if (argc > 2) break;
  }
  return 0;
}
