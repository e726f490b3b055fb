// Meshes manifolds that are known, most of them made to deceive, and counts what is certified. Ends
// with 1 when a certificate was false, or when an honest question was not answered.

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tests/truth/judge.h"

namespace {

using namespace stellate::truth;

struct Settings {
  std::uint64_t cases = 300, seed = 1, only = 0;
  bool single = false, thorough = false, verbose = false;
  std::string family;
};

struct Tally {
  std::uint64_t runs = 0, outcomes[5] = {}, honest = 0, honest_certified = 0;
  std::uint64_t reach_told = 0, reach_near = 0;
  std::vector<std::uint64_t> rounds_unfinished, queries_certified;
  double seconds = 0;

  void Add(const Case& c, const Run& run) {
    ++runs;
    ++outcomes[static_cast<int>(run.outcome)];
    seconds += run.seconds;
    const double reach = c.shape->Reach();
    if (c.epsilon <= 0.4 * reach) {
      ++honest;
      honest_certified += run.outcome == Outcome::kRight || run.outcome == Outcome::kUnseen;
    }
    if (run.outcome == Outcome::kUnfinished) rounds_unfinished.push_back(run.counts.rounds);
    if (run.outcome == Outcome::kRight) queries_certified.push_back(run.counts.queries);
    if (reach > 0 && run.estimated_reach > 0) {
      ++reach_told;
      reach_near += run.estimated_reach >= 0.95 * reach && run.estimated_reach <= 2 * reach;
    }
  }
};

unsigned long long Wide(std::uint64_t n) { return n; }

std::uint64_t Median(std::vector<std::uint64_t> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

Settings Parse(int argc, char** argv) {
  Settings s;
  for (int i = 1; i < argc; ++i) {
    const std::string_view flag = argv[i];
    const auto value = [&] {
      if (++i < argc) return argv[i];
      std::fprintf(stderr, "%s needs a value\n", argv[i - 1]);
      std::exit(2);
    };
    if (flag == "--cases") {
      s.cases = std::strtoull(value(), nullptr, 10);
    } else if (flag == "--seed") {
      s.seed = std::strtoull(value(), nullptr, 10);
    } else if (flag == "--family") {
      s.family = value();
    } else if (flag == "--case") {
      s.only = std::strtoull(value(), nullptr, 10);
      s.single = true;
    } else if (flag == "--thorough") {
      s.thorough = true;
    } else if (flag == "--verbose") {
      s.verbose = true;
    } else {
      std::fprintf(stderr,
                   "truth_campaign [--cases N] [--seed N] [--family NAME [--case N]] [--thorough] "
                   "[--verbose]\n  families:");
      for (const std::string& f : Families()) std::fprintf(stderr, " %s", f.c_str());
      std::fprintf(stderr, "\n");
      std::exit(flag == "--help" ? 0 : 2);
    }
  }
  const std::vector<std::string>& all = Families();
  if (!s.family.empty() && std::find(all.begin(), all.end(), s.family) == all.end()) {
    std::fprintf(stderr, "no family is called %s\n", s.family.c_str());
    std::exit(2);
  }
  return s;
}

const char* NameOf(Outcome outcome) {
  static constexpr const char* kNames[] = {"right", "FALSE", "unseen", "refused", "unfinished"};
  return kNames[static_cast<int>(outcome)];
}

void Print(const std::string& name, const Tally& t) {
  std::printf(
      "%-20s %5llu %6llu %6llu %6llu %7llu %6llu  %4llu/%-4llu %4llu/%-4llu %6llu %7llu %7.1f\n",
      name.c_str(), Wide(t.runs), Wide(t.outcomes[0]), Wide(t.outcomes[1]), Wide(t.outcomes[2]),
      Wide(t.outcomes[3]), Wide(t.outcomes[4]), Wide(t.honest_certified), Wide(t.honest),
      Wide(t.reach_near), Wide(t.reach_told), Wide(Median(t.rounds_unfinished)),
      Wide(Median(t.queries_certified)), t.seconds);
}

}  // namespace

int main(int argc, char** argv) {
  const Settings s = Parse(argc, argv);
  std::map<std::string, Tally> tallies;
  Tally all;
  std::uint64_t wrong = 0;
  const std::vector<std::string> families =
      s.family.empty() ? Families() : std::vector<std::string>{s.family};
  const std::uint64_t each = (s.cases + families.size() - 1) / families.size();
  for (std::uint64_t n = s.single ? s.only : 0; n < (s.single ? s.only + 1 : each); ++n) {
    for (const std::string& family : families) {
      const Case c = MakeCase(family, s.seed, n);
      const Run run = Judge(c, s.thorough);
      tallies[family].Add(c, run);
      all.Add(c, run);
      wrong += run.outcome == Outcome::kFalse && !IsBeyondSeeing(family);
      const bool lost = c.epsilon <= 0.4 * c.shape->Reach() && run.outcome > Outcome::kUnseen;
      if (!s.verbose && run.outcome != Outcome::kFalse && !lost) continue;
      std::printf(
          "%s --family %s --case %llu --seed %llu: k %d, d %d, epsilon %.4g, reach %.4g "
          "(told %.4g), %llu vertices, %llu rounds: %s\n",
          NameOf(run.outcome), family.c_str(), Wide(n), Wide(s.seed), c.shape->k(), c.shape->d(),
          c.epsilon, c.shape->Reach(), run.estimated_reach, Wide(run.counts.vertices),
          Wide(run.counts.rounds), run.told.c_str());
      std::fflush(stdout);
    }
  }
  std::printf("%-20s %5s %6s %6s %6s %7s %6s  %9s %9s %6s %7s %7s\n", "family", "runs", "right",
              "false", "unseen", "refused", "unfin.", "eps<=.4", "reach", "rounds", "queries",
              "seconds");
  for (const auto& [name, tally] : tallies) Print(name, tally);
  Print("all", all);
  const bool answers =
      static_cast<double>(all.honest_certified) >= 0.99 * static_cast<double>(all.honest);
  return wrong == 0 && answers ? 0 : 1;
}
