// Phases: at each point the material whose function is the largest.
#include <algorithm>

#include "oracles/combined/common.h"
#include "oracles/solids/arrangement.h"
#include "stellate/solids.h"

namespace stellate::solids {
namespace {

using Eigen::VectorXd;
using oracles::Refuse;

constexpr size_t kFewest = 2, kMost = 6;  // phases

using Pair = std::pair<size_t, size_t>;

// Each two of so many, the earlier first, in order: wall by wall where the first is the larger.
std::vector<Pair> PairsOf(size_t count) {
  std::vector<Pair> pairs;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) pairs.emplace_back(i, j);
  }
  return pairs;
}

oracles::Wall DifferenceOf(const Phase& one, const Phase& other) {
  oracles::Wall wall{[f = one.f, g = other.f](const VectorXd& x) { return f(x) - g(x); }};
  if (one.gradient && other.gradient) {
    wall.gradient = [df = one.gradient, dg = other.gradient](const VectorXd& x) -> VectorXd {
      return df(x) - dg(x);
    };
  }
  return wall;
}

// The number, from 1, of the phase that is the largest, by the signs of the differences of each
// two; kNoSuchSigns where these are of no order, in which each beats another number of the rest.
std::uint8_t LargestOf(size_t count, const std::vector<Pair>& pairs, size_t code) {
  std::vector<size_t> beaten(count, 0);
  for (size_t wall = 0; wall < pairs.size(); ++wall) {
    const bool first = (code >> wall & 1) != 0;
    ++beaten[first ? pairs[wall].first : pairs[wall].second];
  }
  const auto largest = std::max_element(beaten.begin(), beaten.end()) - beaten.begin();
  std::sort(beaten.begin(), beaten.end());
  for (size_t rank = 0; rank < count; ++rank) {
    if (beaten[rank] != rank) return Oracle::kNoSuchSigns;
  }
  return static_cast<std::uint8_t>(largest + 1);
}

// The walls between each three phases, of which each is zero where the other two are.
std::vector<Walls> TriplesOf(const std::vector<Pair>& pairs) {
  std::vector<Walls> triples;
  const auto wall = [&pairs](size_t i, size_t j) {
    return static_cast<int>(std::find(pairs.begin(), pairs.end(), Pair(i, j)) - pairs.begin());
  };
  for (const auto& [i, j] : pairs) {
    for (const auto& [from, k] : pairs) {
      if (from == j) triples.push_back({wall(i, j), wall(i, k), wall(j, k)});
    }
  }
  return triples;
}

oracles::Solid OracleOf(const std::vector<Phase>& phases, const Solid& within) {
  const Arrangement arrangement(Simplified(within.tree()));
  std::vector<WallPtr> cut = arrangement.walls();
  Labelling inside = arrangement.Labels();
  LeaveOutIdle(&cut, &inside);
  const std::vector<Pair> pairs = PairsOf(phases.size());
  const size_t count = pairs.size() + cut.size();
  if (count > kMostInTables) {
    Refuse(std::to_string(phases.size()) + " phases have " + std::to_string(pairs.size()) +
           " walls, and what they fill has " + std::to_string(cut.size()) + "; there may be " +
           std::to_string(kMostInTables) + " together");
  }
  std::vector<oracles::Wall> walls;
  walls.reserve(count);
  for (const auto& [i, j] : pairs) walls.push_back(DifferenceOf(phases[i], phases[j]));
  for (const WallPtr& wall : cut) walls.push_back(AsFunctions(wall));
  std::vector<std::uint8_t> labels(size_t{1} << count);
  for (size_t code = 0; code < labels.size(); ++code) {
    const std::uint8_t largest = LargestOf(phases.size(), pairs, code);
    const bool is_in = inside[code >> pairs.size()] > 0;
    labels[code] = is_in || largest == Oracle::kNoSuchSigns ? largest : 0;
  }
  return {std::move(walls), within.bounding_box().value(), {}, std::move(labels), TriplesOf(pairs)};
}

}  // namespace

Phases::Phases(std::vector<Phase> phases, const Solid& within)
    : Composed(within.dimension(), [phases, within] { return OracleOf(phases, within); }),
      phases_(std::move(phases)),
      within_(within) {
  if (phases_.size() < kFewest || phases_.size() > kMost) {
    Refuse("phases are of two to six functions, and these are " + std::to_string(phases_.size()));
  }
  for (const Phase& phase : phases_) {
    if (!phase.f) Refuse("phases are of functions, and one of them is none");
  }
}

int Phases::LabelAt(const VectorXd& x) const {
  if (!within_.Contains(x)) return 0;
  std::vector<double> values;
  values.reserve(phases_.size());
  for (const Phase& phase : phases_) values.push_back(phase.f(x));
  return static_cast<int>(std::max_element(values.begin(), values.end()) - values.begin()) + 1;
}

std::vector<std::string> Phases::region_names() const {
  std::vector<std::string> names;
  names.reserve(phases_.size());
  for (const Phase& phase : phases_) names.push_back(phase.name);
  const bool any =
      std::any_of(names.begin(), names.end(), [](const auto& n) { return !n.empty(); });
  return any ? names : std::vector<std::string>();
}

}  // namespace stellate::solids
