// Reconstructs samples of known manifolds, good ones and broken ones, and prints a table of what
// came out. A mesh is right if judge.h counts so, and if GUDHI finds the manifold's homology mod 2.
// Ends with 1 if a wrong one was certified.
//
//   reconstruction_campaign [--seeds N] [--first SEED] [--only TEXT] [--verbose]
//
// --only: a part of a table's name, or of a kind's.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/reconstruction.h"
#include "tests/reconstruction/judge.h"
#include "tests/reconstruction/samples.h"

namespace {

using stellate::core::CertificateLevel;
using stellate::core::Place;
using stellate::testing::Sample;
using stellate::testing::SampleRequest;

// One line of the table: a kind of sample.
struct Kind {
  std::string name;
  SampleRequest sample;
  int k = 0;                  // which is asked for, if not the sample's
  std::vector<Place> causes;  // of a broken one: the places that name what is wrong
  double reach = 0;           // declared, in true ones; 0: none
  bool exact = false;         // tangents given
  stellate::core::Weighting weights = stellate::core::Weighting::kAuto;
  bool steiner = false;
  double drop = 0.001;
  bool beside_plain = false;  // timed beside a run without the two options
};

std::vector<Kind> GoodKinds() {
  std::vector<Kind> kinds;
  for (stellate::testing::NamedRequest& named : stellate::testing::GoodSamples()) {
    Kind& kind = kinds.emplace_back();
    kind.name = std::move(named.name);
    kind.sample = std::move(named.request);
  }
  return kinds;
}

std::vector<Kind> BrokenKinds() {
  std::vector<Kind> kinds;
  const auto add = [&](const char* name, const char* manifold, std::uint32_t points,
                       std::vector<Place> causes) -> Kind& {
    Kind kind;
    kind.name = name;
    kind.sample.manifold = manifold;
    kind.sample.points = points;
    kind.causes = std::move(causes);
    kinds.push_back(kind);
    return kinds.back();
  };
  for (const std::uint32_t points : {25u, 40u, 70u, 120u})
    add("too coarse: torus", "torus", points, {Place::kSparse, Place::kEdge});
  for (const std::uint32_t points : {25u, 60u})
    add("too coarse: klein", "klein", points, {Place::kSparse, Place::kEdge});
  for (const std::uint32_t points : {60u, 150u})
    add("too coarse: so3", "so3", points, {Place::kSparse, Place::kEdge});
  for (const double noise : {.7, 1.0, 1.5})
    for (const char* manifold : {"knot", "torus", "s3"})
      add("too noisy", manifold, 1500, {Place::kNoise}).sample.noise = noise;
  for (const double gap : {.3, .5, .8, 1.0})
    add("two sheets", "shells", 1500, {Place::kSheets, Place::kNoise}).sample.gap = gap;
  add("half a torus, uniform", "half", 1500, {Place::kEdge});
  add("half a torus, even", "half", 1500, {Place::kEdge}).sample.even = true;
  for (const double hole : {2.5, 4.0, 6.0})
    add("hole", "torus", 3000, {Place::kEdge}).sample.hole = hole;
  for (const double share : {.01, .1})
    add("outliers", "torus", 1500, {Place::kNoise, Place::kSheets}).sample.outliers = share;
  // Coarser than 0.4 of the reach: where stars disagree, it is for that.
  add("too coarse: t3", "t3", 2000, {Place::kSparse});
  add("surface as a curve", "torus", 1500, {Place::kNoise, Place::kSparse}).k = 1;
  add("curve as a surface", "knot", 400, {Place::kEdge}).k = 2;
  add("3-manifold as a surface", "t3", 3000, {Place::kNoise, Place::kSparse}).k = 2;
  add("surface as a 3-manifold", "klein", 1500, {Place::kEdge}).k = 3;
  return kinds;
}

std::vector<Kind> ProvedKinds() {
  std::vector<Kind> kinds;
  const auto add = [&](const char* manifold, std::uint32_t points, bool even, bool exact) {
    for (const double reach : {1.0, 2.2}) {
      Kind kind;
      kind.sample.manifold = manifold;
      kind.sample.points = points;
      kind.sample.even = even;
      kind.exact = exact;
      kind.reach = reach;
      char text[100];
      std::snprintf(text, sizeof(text), "%s %s, tangents %s, reach x %g", manifold,
                    even ? "even" : "uniform", exact ? "given" : "estimated", reach);
      kind.name = text;
      kinds.push_back(kind);
    }
  };
  add("circle", 100, false, true);
  add("s2", 600, true, true);
  add("torus", 1500, true, true);
  add("torus", 5000, false, true);
  add("klein", 5000, false, true);
  add("so3", 2500, true, true);
  add("t3", 6000, true, true);
  add("torus", 15000, true, false);
  add("s2", 3000, true, false);
  return kinds;
}

// The options of reconstruct that change how stars are made to agree.
std::vector<Kind> OptionKinds() {
  std::vector<Kind> kinds;
  const auto add = [&](const char* option, const char* manifold, std::uint32_t points,
                       bool even) -> Kind& {
    Kind kind;
    kind.sample.manifold = manifold;
    kind.sample.points = points;
    kind.sample.even = even;
    kind.beside_plain = true;
    char text[100];
    std::snprintf(text, sizeof(text), "%s: %s %s, %u points", option, manifold,
                  even ? "even" : "uniform", points);
    kind.name = text;
    kinds.push_back(kind);
    return kinds.back();
  };
  const auto weigh = [&](const char* manifold, std::uint32_t points, bool even) {
    add("weights only", manifold, points, even).weights = stellate::core::Weighting::kOnly;
  };
  for (const bool even : {true, false}) {
    weigh("knot", 400, even);
    for (const char* manifold : {"s2", "torus", "t2", "klein"}) weigh(manifold, 1500, even);
    weigh("s3", 2000, even);
    weigh("so3", 2500, even);
  }
  weigh("t3", 6000, true);
  const auto add_points = [&](const char* manifold, std::uint32_t points) {
    for (const bool steiner : {false, true}) {
      Kind& kind = add(steiner ? "steiner" : "without", manifold, points, false);
      kind.steiner = steiner;
      kind.drop = 0;
    }
  };
  for (const std::uint32_t points : {250u, 300u, 400u}) add_points("torus", points);
  add_points("klein", 400);
  add_points("t2", 150);
  add_points("so3", 1000);
  return kinds;
}

struct Tally {
  int runs = 0, right = 0, certified = 0, proved = 0, refuted = 0, wrong = 0, named = 0;
  std::uint64_t points = 0, dropped = 0, weighted = 0, added = 0;
  double seconds = 0, plain_seconds = 0;
};

// Whether what most of the unresolved points say is one of the causes.
bool Names(const std::vector<Place>& causes, const stellate::core::ReconstructionCounts& counts) {
  const auto count = [&](Place place) { return counts.places[static_cast<std::size_t>(place)]; };
  std::uint64_t most = 0, named = 0;
  for (int place = static_cast<int>(Place::kEdge); place < stellate::core::kPlaces; ++place)
    most = std::max(most, count(static_cast<Place>(place)));
  for (const Place cause : causes) named = std::max(named, count(cause));
  return named > 0 && named == most;
}

void Run(const Kind& kind, std::uint64_t seed, bool verbose, Tally* tally) {
  SampleRequest request = kind.sample;
  request.seed = seed;
  const Sample sample = Draw(request);
  stellate::core::ReconstructionSpecification spec;
  spec.dimension = kind.k > 0 ? kind.k : sample.k;
  spec.ambient_dimension = sample.d;
  spec.drop = kind.drop;
  if (kind.reach > 0) {
    spec.reach = kind.reach * sample.reach;
    spec.noise = 0;
  }
  const auto reconstruct = [&](double* seconds) {
    const std::clock_t before = std::clock();
    auto made = stellate::core::Reconstruct(
        spec, {sample.points, kind.exact ? sample.tangents : Eigen::MatrixXd()});
    *seconds += static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    return made;
  };
  if (kind.beside_plain) reconstruct(&tally->plain_seconds);
  spec.weights = kind.weights;
  spec.steiner = kind.steiner;
  const auto result = reconstruct(&tally->seconds);
  ++tally->runs;
  if (!result) {
    std::printf("%s, seed %d: %s\n", kind.name.c_str(), static_cast<int>(seed),
                result.error().message.c_str());
    return;
  }
  const auto& certificate = result->report.certificate;
  const auto& counts = *result->report.reconstruction;
  const auto n = static_cast<std::uint32_t>(sample.points.cols());
  const auto vertices = static_cast<std::uint32_t>(n + result->added.cols());
  const bool right =
      spec.dimension == sample.k &&
      IsRight(stellate::testing::Count(sample.k, result->simplices, vertices), sample) &&
      HasHomologyOf(sample, result->simplices);
  const bool is_broken = !kind.causes.empty();
  // A hole is no fault of the mesh's topology, and neither is a coarse sample that comes out right.
  const bool wrong = certificate.certified && !right;
  tally->points += n;
  tally->dropped += counts.places[static_cast<std::size_t>(Place::kDropped)];
  tally->weighted += counts.places[static_cast<std::size_t>(Place::kWeighted)];
  tally->added += counts.places[static_cast<std::size_t>(Place::kAdded)];
  tally->right += right;
  tally->certified += certificate.certified;
  tally->proved += certificate.level == CertificateLevel::kProved;
  tally->refuted += certificate.reach_refuted;
  tally->wrong += wrong;
  tally->named += is_broken && (certificate.certified || Names(kind.causes, counts));
  if (verbose && (wrong || (is_broken ? !Names(kind.causes, counts) : !certificate.certified))) {
    std::printf("  seed %d, n %u, right %d: %s |", static_cast<int>(seed), n, right,
                certificate.verdict.c_str());
    for (int place = 0; place < stellate::core::kPlaces; ++place)
      if (counts.places[place] > 0)
        std::printf(" %s %d", PlaceName(static_cast<Place>(place)),
                    static_cast<int>(counts.places[place]));
    std::printf(" | noise ratio %.3f\n", counts.noise_ratio);
  }
}

void Print(const char* name, const Tally& tally) {
  std::printf("| %s | %d | %d | %d | %d | %d | %d | %d | %d | %d | %d | %.1f | ", name, tally.runs,
              tally.right, tally.certified, tally.proved, tally.refuted, tally.wrong, tally.named,
              static_cast<int>(tally.dropped), static_cast<int>(tally.weighted),
              static_cast<int>(tally.added),
              1e6 * tally.seconds / static_cast<double>(tally.points));
  if (tally.plain_seconds > 0)
    std::printf("%.2f |\n", tally.seconds / tally.plain_seconds);
  else
    std::printf("- |\n");
}

bool RunAll(const char* title, const std::vector<Kind>& kinds, std::uint64_t first,
            std::uint64_t seeds, std::string_view only, bool verbose) {
  std::printf(
      "\n| %s | runs | right | certified | proved | refuted | wrong and certified | cause named | "
      "dropped | weighted | added | us a point | times the plain run |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      title);
  Tally all;
  for (const Kind& kind : kinds) {
    if ((title + (": " + kind.name)).find(only) == std::string::npos) continue;
    Tally tally;
    for (std::uint64_t seed = first; seed < first + seeds; ++seed) Run(kind, seed, verbose, &tally);
    Print(kind.name.c_str(), tally);
    std::fflush(stdout);
    all.runs += tally.runs;
    all.right += tally.right;
    all.certified += tally.certified;
    all.proved += tally.proved;
    all.refuted += tally.refuted;
    all.wrong += tally.wrong;
    all.named += tally.named;
    all.dropped += tally.dropped;
    all.points += tally.points;
    all.weighted += tally.weighted;
    all.added += tally.added;
    all.seconds += tally.seconds;
    all.plain_seconds += tally.plain_seconds;
  }
  if (all.runs > 0) Print("all", all);
  return all.wrong == 0;
}

}  // namespace

int main(int count, char** arguments) {
  std::uint64_t seeds = 3, first = 1;
  std::string only;
  bool verbose = false;
  for (int i = 1; i < count; ++i) {
    const std::string_view argument = arguments[i];
    const char* const value = i + 1 < count ? arguments[i + 1] : "";
    if (argument == "--seeds")
      seeds = static_cast<std::uint64_t>(std::atoll(value)), ++i;
    else if (argument == "--first")
      first = static_cast<std::uint64_t>(std::atoll(value)), ++i;
    else if (argument == "--only")
      only = value, ++i;
    else if (argument == "--verbose")
      verbose = true;
    else
      return std::fprintf(stderr,
                          "reconstruction_campaign [--seeds N] [--first SEED] [--only TEXT] "
                          "[--verbose]\n"),
             2;
  }
  bool sound = RunAll("good samples", GoodKinds(), first, seeds, only, verbose);
  sound = RunAll("broken samples", BrokenKinds(), first, seeds, only, verbose) && sound;
  sound = RunAll("options", OptionKinds(), first, seeds, only, verbose) && sound;
  sound = RunAll("declared reach", ProvedKinds(), first, seeds, only, verbose) && sound;
  return sound ? 0 : 1;
}
