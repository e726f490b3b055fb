#include "core/run/crease_search.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <utility>

#include "core/base/instantiate.h"
#include "core/run/ending.h"

namespace stellate::core {
namespace {

constexpr double kLongestWay = 2;  // of epsilon
// In epsilon. A front has edges so short, along which tangent spaces turn by 30 degrees, only at
// creases, or where M bends far more sharply than the mesh is fine.
constexpr double kTellingWay = 0.5, kTellingSine2 = 0.25;

constexpr std::size_t kPlacesProbed = 5;  // where M's dimension is looked at

}  // namespace

template <int K>
CreaseSearch<K>::CreaseSearch(const Specification& spec)
    : epsilon_(spec.epsilon),
      is_domain_(K == spec.ambient_dimension),
      probe_(spec),
      dimension_(spec) {}

template <int K>
void CreaseSearch<K>::Watch(const Engine<K>& engine) {
  const ViolationIndex<K>& violations = engine.violations();
  const bool due = watch_.IsDue(violations.size_and_shape().size() + violations.violating(),
                                !violations.are_all_dirty());
  if (probe_.is_asking() || is_domain_) return;
  if (due)
    probe_.Start(SteepWaysAtFaults<K>(engine, kLongestWay * epsilon_, kLeastSine2, &walked_));
  else if (watch_.MayLookAgain())
    probe_.Start(SteepWaysAtFaults<K>(engine, kTellingWay * epsilon_, kTellingSine2, &walked_));
}

template <int K>
void CreaseSearch<K>::ProbeFaults(const Engine<K>& engine) {
  probe_.Start(SteepWaysAtFaults<K>(engine, kLongestWay * epsilon_));
}

template <int K>
void CreaseSearch<K>::ProbeAll(const Stars<K>& stars) {
  probe_.Start(SteepWays<K>(stars, kLongestWay * epsilon_));
}

template <int K>
void CreaseSearch<K>::Stop() {
  probe_.Stop();
  dimension_.Stop();
  walked_.clear();
}

template <int K>
void CreaseSearch<K>::ProbeDimension(const Engine<K>& engine) {
  const Stars<K>& stars = engine.stars();
  std::vector<std::uint32_t> inside;
  for (std::uint32_t p = 0; p < stars.size(); ++p)
    if (stars.sample().walls(p) == 0) inside.push_back(p);
  const std::size_t count = std::min(inside.size(), kPlacesProbed);
  Eigen::MatrixXd places(stars.sample().d(), static_cast<Eigen::Index>(count));
  std::vector<double> sizes(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t p = inside[i * inside.size() / count];
    places.col(static_cast<Eigen::Index>(i)) =
        Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(p), stars.sample().d());
    sizes[i] = std::min(epsilon_, engine.sizes().BoundAt(stars, p));
  }
  dimension_.Start(places, sizes);
}

template <int K>
std::string CreaseSearch<K>::Describe() const {
  if (crease()) return DescribeCrease(*crease());
  return dimension_.found() ? DescribeOtherDimension(*dimension_.found(), K) : "";
}

template <int K>
void CreaseSearch<K>::Ask(std::vector<QueryBlock>* blocks) {
  const std::initializer_list<QuerySource*> sources = {&probe_, &dimension_};
  for (QuerySource* const source : sources)
    for (QueryBlock& block : source->Questions()) {
      open_.emplace_back(source, blocks->size());
      blocks->push_back(std::move(block));
    }
}

template <int K>
void CreaseSearch<K>::Absorb(const std::vector<AnswerBlock>& answers) {
  for (const auto& [source, block] : std::exchange(open_, {})) source->Absorb({answers[block]});
}

STELLATE_INSTANTIATE_CLASS(CreaseSearch)

}  // namespace stellate::core
