// Meshes manifolds that are known, most of them made to deceive, and counts what is certified. Ends
// with 1 when a certificate was false, when an honest question was not answered, or when a reach
// was told wrongly.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <istream>
#include <limits>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/truth/judge.h"

namespace {

using namespace stellate::truth;

// The reach that is told, in true ones: an estimate from above, of which tangent spaces that are
// estimated, too, take up to a tenth (docs/evidence/questions.md).
constexpr double kLeastTold = 0.9, kMostTold = 2;

struct Settings {
  std::uint64_t cases = 300, seed = 1, only = 0;
  bool single = false, thorough = false, verbose = false;
  double declared = 0;  // in true reaches
  std::string family, log;
};

// What is kept of a run: a line of the log.
struct Record {
  std::string family;
  std::uint64_t number = 0;
  Outcome outcome = Outcome::kUnfinished;
  double fineness = 0;  // epsilon over the reach; infinity where there is none
  double told = 0;      // the reach that was told, over the true one; 0 where none was
  std::uint64_t rounds = 0, queries = 0;
  double seconds = 0;
  bool proved = false;

  bool honest() const { return fineness <= 0.4; }
  bool certified() const { return outcome == Outcome::kRight || outcome == Outcome::kUnseen; }
  // What no question can see is promised by no certificate, but by a proof from a true reach.
  bool wrong() const { return outcome == Outcome::kFalse && (proved || !IsBeyondSeeing(family)); }
};

Record RecordOf(const Case& c, std::uint64_t number, const Run& run) {
  const double reach = c.shape->Reach();
  return {c.family,
          number,
          run.outcome,
          reach > 0 ? c.epsilon / reach : std::numeric_limits<double>::infinity(),
          reach > 0 ? run.estimated_reach / reach : 0,
          run.counts.rounds,
          run.counts.queries,
          run.seconds,
          run.proved};
}

std::ostream& operator<<(std::ostream& out, const Record& r) {
  return out << r.family << ' ' << r.number << ' ' << static_cast<int>(r.outcome) << ' '
             << (std::isinf(r.fineness) ? -1 : r.fineness) << ' ' << r.told << ' ' << r.rounds
             << ' ' << r.queries << ' ' << r.seconds << ' ' << r.proved << '\n';
}

std::istream& operator>>(std::istream& in, Record& r) {
  int outcome = 0;
  in >> r.family >> r.number >> outcome >> r.fineness >> r.told >> r.rounds >> r.queries >>
      r.seconds >> r.proved;
  r.outcome = static_cast<Outcome>(outcome);
  if (r.fineness < 0) r.fineness = std::numeric_limits<double>::infinity();
  return in;
}

struct Tally {
  std::uint64_t runs = 0, outcomes[5] = {}, proved = 0, honest = 0, honest_certified = 0, wrong = 0;
  // Of those that were certified, rightly: others only bound it.
  std::uint64_t reach_told = 0, reach_right = 0;
  std::vector<std::uint64_t> rounds_unfinished, queries_certified;
  double seconds = 0;

  void Add(const Record& r) {
    ++runs;
    ++outcomes[static_cast<int>(r.outcome)];
    wrong += r.wrong();
    proved += r.proved;
    seconds += r.seconds;
    honest += r.honest();
    honest_certified += r.honest() && r.certified();
    if (r.outcome == Outcome::kRight) queries_certified.push_back(r.queries);
    if (r.outcome == Outcome::kUnfinished) {
      rounds_unfinished.push_back(r.rounds);
    } else if (r.outcome == Outcome::kRight && r.told > 0) {
      ++reach_told;
      reach_right += r.told >= kLeastTold && r.told <= kMostTold;
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
    } else if (flag == "--log") {
      s.log = value();
    } else if (flag == "--declare") {
      s.declared = std::strtod(value(), nullptr);
    } else if (flag == "--thorough") {
      s.thorough = true;
    } else if (flag == "--verbose") {
      s.verbose = true;
    } else {
      std::fprintf(stderr,
                   "truth_campaign [--cases N] [--seed N] [--family NAME [--case N]] [--thorough] "
                   "[--declare SHARE] [--log FILE] [--verbose]\n"
                   "  --declare: the reach is declared, at so many true ones\n"
                   "  --log: results are added to FILE, and those that it has are not run again\n"
                   "  families:");
      for (const std::string& f : Families()) std::fprintf(stderr, " %s", f.c_str());
      std::fprintf(stderr, "\n");
      std::exit(flag == "--help" ? 0 : 2);
    }
  }
  if (!(s.declared >= 0 && s.declared <= 1)) {
    std::fprintf(stderr, "--declare must be above 0 and at most 1\n");
    std::exit(2);
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
      "%-20s %5llu %6llu %6llu %6llu %6llu %7llu %6llu  %4llu/%-4llu %4llu/%-4llu %6llu %7llu "
      "%7.1f\n",
      name.c_str(), Wide(t.runs), Wide(t.proved), Wide(t.outcomes[0]), Wide(t.outcomes[1]),
      Wide(t.outcomes[2]), Wide(t.outcomes[3]), Wide(t.outcomes[4]), Wide(t.honest_certified),
      Wide(t.honest), Wide(t.reach_right), Wide(t.reach_told), Wide(Median(t.rounds_unfinished)),
      Wide(Median(t.queries_certified)), t.seconds);
}

void Print(const std::map<std::string, Tally>& tallies, const Tally& all) {
  std::printf("%-20s %5s %6s %6s %6s %6s %7s %6s  %9s %9s %6s %7s %7s\n", "family", "runs",
              "proved", "right", "false", "unseen", "refused", "unfin.", "eps<=.4", "reach",
              "rounds", "queries", "seconds");
  for (const auto& [name, tally] : tallies) Print(name, tally);
  Print("all", all);
}

void Tell(const Settings& s, const Case& c, std::uint64_t n, const Run& run) {
  std::printf(
      "%s --family %s --case %llu --seed %llu: k %d, d %d, epsilon %.4g, reach %.4g "
      "(told %.4g), %llu vertices, %llu rounds: %s\n",
      NameOf(run.outcome), c.family.c_str(), Wide(n), Wide(s.seed), c.shape->k(), c.shape->d(),
      c.epsilon, c.hole > 0 ? c.hole : c.shape->Reach(), run.estimated_reach,
      Wide(run.counts.vertices), Wide(run.counts.rounds), run.told.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const Settings s = Parse(argc, argv);
  std::map<std::pair<std::string, std::uint64_t>, Record> known;
  std::ofstream log;
  if (!s.log.empty()) {
    std::ifstream before(s.log);
    for (Record r; before >> r;) known[{r.family, r.number}] = r;
    log.open(s.log, std::ios::app);
  }
  std::map<std::string, Tally> tallies;
  Tally all;
  const std::vector<std::string> families =
      s.family.empty() ? Families() : std::vector<std::string>{s.family};
  const std::uint64_t each = (s.cases + families.size() - 1) / families.size();
  for (std::uint64_t n = s.single ? s.only : 0; n < (s.single ? s.only + 1 : each); ++n) {
    for (const std::string& family : families) {
      Record record;
      if (const auto found = known.find({family, n}); found != known.end()) {
        record = found->second;
      } else {
        const Case c = MakeCase(family, s.seed, n);
        const Run run = Judge(c, s.thorough, s.declared);
        record = RecordOf(c, n, run);
        if (log.is_open()) log << record << std::flush;
        const bool lost = record.honest() && !record.certified();
        if (s.verbose || lost || run.outcome == Outcome::kFalse) Tell(s, c, n, run);
      }
      tallies[family].Add(record);
      all.Add(record);
    }
  }
  Print(tallies, all);
  // A declared reach may need more vertices than there are to be.
  const bool answers = s.declared > 0 || static_cast<double>(all.honest_certified) >=
                                             0.99 * static_cast<double>(all.honest);
  return all.wrong == 0 && answers && all.reach_right == all.reach_told ? 0 : 1;
}
