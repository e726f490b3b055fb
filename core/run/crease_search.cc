#include "core/run/crease_search.h"

#include <utility>

#include "core/base/instantiate.h"

namespace stellate::core {
namespace {

constexpr double kLongestWay = 2;  // of epsilon
// In epsilon. A front has edges so short, along which tangent spaces turn by 30 degrees, only at
// creases, or where M bends far more sharply than the mesh is fine.
constexpr double kTellingWay = 0.5, kTellingSine2 = 0.25;

}  // namespace

template <int K>
CreaseSearch<K>::CreaseSearch(const Specification& spec)
    : epsilon_(spec.epsilon), is_domain_(K == spec.ambient_dimension), probe_(spec) {}

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
  walked_.clear();
}

template <int K>
void CreaseSearch<K>::Ask(std::vector<QueryBlock>* blocks) {
  block_ = blocks->size();
  blocks->push_back(std::move(probe_.Questions().front()));
}

template <int K>
void CreaseSearch<K>::Absorb(const std::vector<AnswerBlock>& answers) {
  if (!block_) return;
  probe_.Absorb({answers[*block_]});
  block_.reset();
}

STELLATE_INSTANTIATE_CLASS(CreaseSearch)

}  // namespace stellate::core
