#include "core/refinement/protection.h"

#include <algorithm>

#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/rules/r5_protection.h"

namespace stellate::core {
namespace {

// Where protection is reached at all, it took 2 to 20 % more vertices, and every few rounds left
// fewer weak stars.
constexpr double kMostProtectionGrowth = 1.5;
constexpr std::uint64_t kLeastProtectionGrowth = 200;
constexpr std::uint64_t kPatience = 60;

}  // namespace

template <int K>
void Protection<K>::Note(const Stars<K>& stars, const std::vector<std::uint32_t>& changed,
                         std::uint32_t first) {
  if (is_protected_.empty()) return;  // none was judged
  is_protected_.resize(stars.size(), 0);
  for (const std::uint32_t p : changed) is_protected_[p] = 0;
  const double farthest = 2 * stars.sample().epsilon() + delta_;
  for (std::uint32_t q = first; q < stars.size(); ++q) {
    CheckInterruption(q);
    stars.sample().ForEachWithin(stars.sample().Point(q), farthest,
                                 [&](std::uint32_t p) { is_protected_[p] = 0; });
  }
}

template <int K>
bool Protection<K>::HasGoneTooFar(std::uint64_t vertices) {
  if (vertices_before_ == 0) vertices_before_ = vertices;
  if (fewest_ == 0 || weak_ < fewest_) {
    fewest_ = weak_;
    rounds_since_ = 0;
  }
  const double most = std::max(kMostProtectionGrowth * static_cast<double>(vertices_before_),
                               static_cast<double>(vertices_before_ + kLeastProtectionGrowth));
  return ++rounds_since_ > kPatience || static_cast<double>(vertices) > most;
}

template <int K>
std::vector<typename Protection<K>::Entry> Protection<K>::Judge(const Stars<K>& stars) {
  if (!is_asked() || is_given_up_) return {};
  is_protected_.resize(stars.size(), 0);
  std::vector<Entry> found =
      ParallelGather<Entry>(stars.size(), [&](std::size_t i, std::vector<Entry>* weak) {
        if (is_protected_[i]) return;
        const auto p = static_cast<std::uint32_t>(i);
        const auto violation = WorstUnprotected<K>(stars, p, delta_);
        if (violation)
          weak->push_back({p, *violation});
        else
          is_protected_[i] = 1;
      });
  weak_ = found.size();
  if (!found.empty() && HasGoneTooFar(stars.size())) {
    is_given_up_ = true;
    return {};
  }
  return found;
}

STELLATE_INSTANTIATE_CLASS(Protection)

}  // namespace stellate::core
