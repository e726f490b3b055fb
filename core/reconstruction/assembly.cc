#include "core/reconstruction/assembly.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "core/base/infinity.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/index/indexed_points.h"
#include "core/reconstruction/added_points.h"
#include "core/reconstruction/tiled_stars.h"
#include "core/reconstruction/weights.h"

namespace stellate::core {
namespace {

// In local spacings: what a change around a cavity may change, and the points that decide the stars
// there.
constexpr double kChanged = 4;
constexpr double kDeciding = 9;
// Points around which nothing is tried: a star is open, or the noise has no bound, so near.
constexpr double kHopelessNear = 3;
constexpr double kMostNoise = 0.8;
// Where more than this share of the points is in cavities, the sample is broken as a whole.
constexpr double kMostLeft = 0.02;
constexpr std::size_t kFewLeft = 64;
constexpr int kSweeps = 6;
constexpr int kDropRounds = 12;
constexpr int kAddRounds = 6;

void SortOut(std::vector<std::uint32_t>* ids) {
  std::sort(ids->begin(), ids->end());
  ids->erase(std::unique(ids->begin(), ids->end()), ids->end());
}

template <int K>
class Assembler {
 public:
  Assembler(FittedCloud* cloud, const AssemblyRequest& request)
      : cloud_(*cloud), request_(request), own_(cloud->size), spacing_(Median(cloud->spacing)) {}

  Assembly Run(FunctionRef<void(double)> done) {
    std::vector<std::uint32_t> all(cloud_.size);
    std::iota(all.begin(), all.end(), 0u);
    if ((request_.exudes || request_.weights_only) && Exude(all, 0, done))
      return std::move(result_);
    Begin(BuildAll(all, K >= 3 ? CentreRule::kCommonCentre : CentreRule::kTangentSpace));
    done(0.5);
    if (K >= 3 && IsWorthMore()) Begin(BuildAll(all, CentreRule::kTangentSpace));
    done(0.7);
    DropStrays();
    if (IsWorthMore()) Weigh();
    done(0.85);
    int round = 0;
    while (round < kDropRounds && IsWorthMore() && Drop()) ++round;
    done(0.9);
    for (round = 0; round < kAddRounds && IsWorthMore() && Add();) ++round;
    RemoveVain();
    if (request_.exudes_at_last && !left_.empty() && cloud_.size == own_ && Exude(all, 0.9, done))
      return std::move(result_);
    done(1);
    MarkLeft();
    return std::move(result_);
  }

 private:
  TiledStars BuildAll(const std::vector<std::uint32_t>& ids, CentreRule rule) {
    return BuildTiledStars<K>(cloud_, {.ids = ids, .rule = rule, .spacing = spacing_});
  }

  // Takes the stars of weighted points if all agree, or if there is to be nothing else. Returns
  // whether it did. `from`: the share of the work that is done before.
  bool Exude(const std::vector<std::uint32_t>& all, double from, FunctionRef<void(double)> done) {
    ExudingWeights found =
        FindExudingWeights<K>(cloud_, [&](double share) { done(from + 0.5 * (1 - from) * share); });
    if (!found.agree && !request_.weights_only) return false;
    TiledStars stars = BuildTiledStars<K>(cloud_, {.ids = all,
                                                   .weights = &found.weights,
                                                   .spacing = spacing_,
                                                   .tiles = !request_.weights_only});
    if (!stars.unfilled.empty() && !request_.weights_only) return false;
    Begin(std::move(stars));
    for (std::uint32_t p = 0; p < cloud_.size; ++p)
      if (found.weights[p] > 0) result_.places[p] = Place::kWeighted;
    result_.weights = std::move(found.weights);
    MarkLeft();
    done(1);
    return true;
  }

  void MarkLeft() {
    for (const std::uint32_t p : left_) result_.places[p] = Place::kDisagree;
  }

  void Begin(TiledStars stars) {
    const std::uint64_t doubtful = result_.doubtful, cavities = result_.cavities;
    result_ = {};
    result_.simplices = std::move(stars.simplices);
    result_.places.assign(cloud_.size, Place::kOk);
    for (const std::uint32_t p : stars.tiled) result_.places[p] = Place::kTiled;
    result_.radii = std::move(stars.radii);
    result_.doubtful = doubtful > 0 ? doubtful : stars.doubtful;
    result_.cavities = cavities > 0 ? cavities : stars.cavities;
    result_.tiles = stars.tiles;
    left_ = std::move(stars.unfilled);
    FindHopeful();
  }

  bool IsHopeless(std::uint32_t p) const {
    return !(result_.radii[p] <= OpenRadius(cloud_, p)) ||
           cloud_.noise[p] > kMostNoise * cloud_.spacing[p];
  }

  bool IsFewLeft() const {
    return left_.size() <= std::max(kFewLeft, static_cast<std::size_t>(
                                                  kMostLeft * static_cast<double>(cloud_.size)));
  }

  // Keeps the vertices of cavities that a weight or a point less may help.
  void FindHopeful() {
    hopeful_.clear();
    if (!IsFewLeft()) return;
    std::vector<std::uint32_t> hopeless;
    for (const std::uint32_t p : left_)
      if (p < own_ && IsHopeless(p)) hopeless.push_back(p);
    for (const std::uint32_t p : left_) {
      ThrowIfInterrupted();
      const double far = kHopelessNear * cloud_.spacing[p];
      if (result_.places[p] != Place::kDropped && !IsNear(p, hopeless, far)) hopeful_.push_back(p);
    }
  }

  bool IsNear(std::uint32_t p, const std::vector<std::uint32_t>& others, double far) const {
    return std::any_of(others.begin(), others.end(), [&](std::uint32_t q) {
      return SquaredDistance(cloud_.Position(p), cloud_.Position(q), cloud_.d) < far * far;
    });
  }

  bool IsWorthMore() const { return !hopeful_.empty(); }

  // Of the points that the cloud had.
  const BallTree& Tree() {
    if (!points_) {
      points_.emplace(cloud_.d);
      for (std::uint32_t p = 0; p < own_; ++p) points_->AddUnindexed(cloud_.Position(p));
      points_->Index();
    }
    return points_->tree();
  }

  // Returns the points within so many of their spacings of some of the centres, ascending.
  std::vector<std::uint32_t> Around(std::span<const std::uint32_t> centres, double spacings) {
    std::vector<std::uint8_t> found(cloud_.size);
    for (const std::uint32_t p : centres) {
      ThrowIfInterrupted();
      const double radius = spacings * cloud_.spacing[p];
      Tree().VisitNear(
          cloud_.Position(p), [&] { return radius; },
          [&](std::uint32_t q, double) { found[q] = result_.places[q] != Place::kDropped; });
      for (std::uint32_t q = own_; q < cloud_.size; ++q)
        if (IsNear(p, {q}, radius)) found[q] = 1;
    }
    std::vector<std::uint32_t> ids;
    for (std::uint32_t p = 0; p < cloud_.size; ++p)
      if (found[p]) ids.push_back(p);
    return ids;
  }

  void Weigh() {
    std::vector<double> weights(cloud_.size, 0.0);
    const std::vector<std::uint32_t> weighted =
        AddWeights<K>(cloud_, Around(hopeful_, kDeciding), hopeful_, kSweeps, &weights);
    if (weighted.empty()) return;
    std::vector<std::uint32_t> centres = hopeful_;
    centres.insert(centres.end(), weighted.begin(), weighted.end());
    SortOut(&centres);
    std::vector<double> kept(cloud_.size, 0.0);
    for (const std::uint32_t p :
         Replace(Around(centres, kChanged), Around(centres, kDeciding), &weights))
      kept[p] = weights[p];
    if (std::any_of(kept.begin(), kept.end(), [](double w) { return w > 0; }))
      result_.weights = std::move(kept);
    FindHopeful();
  }

  // Drops points far from all others, which no simplex has: the mesh is whole without them, where
  // no cavity is near.
  void DropStrays() {
    std::vector<std::uint8_t> used(cloud_.size);
    for (const std::uint32_t p : result_.simplices) used[p] = 1;
    std::vector<std::uint32_t> cavities;
    for (const std::uint32_t p : left_)
      if (used[p]) cavities.push_back(p);
    for (std::uint32_t p = 0; p < own_ && dropped_ < request_.most_dropped; ++p) {
      CheckInterruption(p);
      if (used[p] || result_.radii[p] <= OpenRadius(cloud_, p)) continue;
      if (IsNear(p, cavities, kChanged * spacing_)) continue;
      result_.places[p] = Place::kDropped;
      ++dropped_;
    }
    std::erase_if(left_, [&](std::uint32_t p) { return result_.places[p] == Place::kDropped; });
    FindHopeful();
  }

  // Drops a point in each cavity, as far as that is allowed. Returns whether it did.
  bool Drop() {
    std::vector<std::uint32_t> out;
    for (const std::uint32_t p : InOrderOfDropping()) {
      if (dropped_ + out.size() >= request_.most_dropped) break;
      if (!IsNear(p, out, kChanged * cloud_.spacing[p])) out.push_back(p);
    }
    if (out.empty()) return false;
    std::vector<std::uint32_t> changed = Around(hopeful_, kChanged);
    for (const std::uint32_t p : out) result_.places[p] = Place::kDropped;
    dropped_ += out.size();
    Replace(std::move(changed), Around(hopeful_, kDeciding), Weights());
    FindHopeful();
    return true;
  }

  // First come points in no simplex, the highest over the others first; then the nearest pairs.
  std::vector<std::uint32_t> InOrderOfDropping() const {
    std::vector<std::uint8_t> used(cloud_.size);
    for (const std::uint32_t p : result_.simplices) used[p] = 1;
    std::vector<std::uint32_t> order = hopeful_;
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      if (used[a] != used[b]) return used[a] < used[b];
      if (used[a] == 0 && cloud_.height[a] != cloud_.height[b])
        return cloud_.height[a] > cloud_.height[b];
      return cloud_.nearest[a] != cloud_.nearest[b] ? cloud_.nearest[a] < cloud_.nearest[b] : a < b;
    });
    return order;
  }

  // Adds a point to each cavity, as far as that is allowed. Returns whether it did. It is a vertex
  // of the cavity until all stars there agree.
  bool Add() {
    const std::uint32_t before = cloud_.size;
    std::vector<std::uint32_t> seeds;
    for (const std::uint32_t seed : hopeful_) {
      if (cloud_.size - own_ >= request_.most_added) break;
      if (IsNear(seed, seeds, kChanged * cloud_.spacing[seed])) continue;
      seeds.push_back(seed);
      std::vector<std::uint32_t> cavity;
      for (const std::uint32_t p : left_)
        if (IsNear(p, {seed}, kHopelessNear * cloud_.spacing[seed])) cavity.push_back(p);
      if (const auto emptiest = FindEmptiest(cloud_, cavity)) AddPoint(Tree(), *emptiest, &cloud_);
    }
    if (cloud_.size == before) return false;
    for (std::uint32_t p = before; p < cloud_.size; ++p) left_.push_back(p);
    result_.places.resize(cloud_.size, Place::kAdded);
    result_.radii.resize(cloud_.size, kInfinity);
    if (!result_.weights.empty()) result_.weights.resize(cloud_.size, 0);
    Replace(Around(left_, kChanged), Around(left_, kDeciding), Weights());
    FindHopeful();
    return true;
  }

  // Removes the points that were added in vain.
  void RemoveVain() {
    std::vector<std::uint32_t> names(cloud_.size);
    for (const std::uint32_t p : result_.simplices) names[p] = 1;
    std::vector<std::uint32_t> vain;
    for (std::uint32_t p = 0; p < cloud_.size; ++p) {
      if (p >= own_ && names[p] == 0) vain.push_back(p);
      names[p] = p - static_cast<std::uint32_t>(vain.size());
    }
    for (std::uint32_t& p : result_.simplices) p = names[p];
    for (auto p = vain.rbegin(); p != vain.rend(); ++p) {
      RemovePoint(*p, &cloud_);
      result_.places.erase(result_.places.begin() + *p);
      result_.radii.erase(result_.radii.begin() + *p);
      if (!result_.weights.empty()) result_.weights.erase(result_.weights.begin() + *p);
    }
    std::erase_if(left_, [&](std::uint32_t p) { return p >= own_; });
  }

  const std::vector<double>* Weights() const {
    return result_.weights.empty() ? nullptr : &result_.weights;
  }

  std::vector<std::uint32_t> Replace(std::vector<std::uint32_t> changed,
                                     std::vector<std::uint32_t> deciding,
                                     const std::vector<double>* weights);

  FittedCloud& cloud_;
  const AssemblyRequest request_;
  const std::uint32_t own_;  // points that the cloud had
  const double spacing_;
  Assembly result_;
  std::vector<std::uint32_t> left_;     // vertices of cavities that are not filled, ascending
  std::vector<std::uint32_t> hopeful_;  // those for which more is tried
  std::optional<IndexedPoints> points_;
  std::uint64_t dropped_ = 0;
};

// Takes over, on some points, a mesh that was made anew around them. The points fall into parts
// that no simplex of either mesh joins, and each part is taken over or left as a whole.
template <int K>
class PartExchange {
 public:
  static constexpr std::size_t kWidth = K + 1;
  using Simplex = std::array<std::uint32_t, kWidth>;
  using Simplices = std::vector<std::uint32_t>;

  // `changed`: ascending, of a cloud of `size` points.
  PartExchange(const std::vector<std::uint32_t>& changed, std::uint32_t size,
               const Simplices& before, const Simplices& after)
      : before_(before), after_(after), number_(size, kNone), up_(changed.size()) {
    for (std::size_t i = 0; i < changed.size(); ++i)
      number_[changed[i]] = static_cast<std::uint32_t>(i);
    std::iota(up_.begin(), up_.end(), 0u);
    old_ = Touching(before_);
    new_ = Touching(after_);
    fits_.assign(changed.size(), 1);
    // It fits if the simplices that join a part to other points are the same.
    std::map<std::uint32_t, std::array<std::vector<Simplex>, 2>> seams;
    for (const std::size_t at : old_) NoteSeam(before_.data() + at, 0, &seams);
    for (const std::size_t at : new_) NoteSeam(after_.data() + at, 1, &seams);
    for (auto& [part, sides] : seams) fits_[part] = sides[0] == sides[1];
  }

  // Leaves the part of a point as it is.
  void Refuse(std::uint32_t p) {
    if (number_[p] != kNone) fits_[Root(number_[p])] = 0;
  }
  // Whether the part of a changed point is taken over.
  bool Takes(std::uint32_t p) { return fits_[Root(number_[p])] != 0; }

  Simplices Result() {
    std::vector<Simplex> all;
    const auto add = [&](const Simplices& from, std::size_t at) {
      all.emplace_back();
      std::copy_n(from.data() + at, kWidth, all.back().begin());
    };
    auto next = old_.begin();
    for (std::size_t at = 0; at < before_.size(); at += kWidth) {
      if (next != old_.end() && *next == at) {
        ++next;
        if (fits_[PartOf(before_.data() + at)]) continue;
      }
      add(before_, at);
    }
    for (const std::size_t at : new_)
      if (fits_[PartOf(after_.data() + at)]) add(after_, at);
    std::sort(all.begin(), all.end());
    Simplices result;
    result.reserve(all.size() * kWidth);
    for (const Simplex& s : all) result.insert(result.end(), s.begin(), s.end());
    return result;
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  std::uint32_t Root(std::uint32_t i) {
    while (up_[i] != i) i = up_[i] = up_[up_[i]];
    return i;
  }

  // Returns where the simplices that touch changed points are, and joins these points.
  std::vector<std::size_t> Touching(const Simplices& simplices) {
    std::vector<std::size_t> found;
    for (std::size_t at = 0; at < simplices.size(); at += kWidth) {
      CheckInterruption(at / kWidth);
      std::uint32_t first = kNone;
      for (std::size_t i = 0; i < kWidth; ++i) {
        const std::uint32_t n = number_[simplices[at + i]];
        if (n == kNone) continue;
        if (first == kNone) first = n;
        const std::uint32_t a = Root(first), b = Root(n);
        up_[std::max(a, b)] = std::min(a, b);
      }
      if (first != kNone) found.push_back(at);
    }
    return found;
  }

  std::uint32_t PartOf(const std::uint32_t* ids) {
    std::size_t i = 0;
    while (number_[ids[i]] == kNone) ++i;
    return Root(number_[ids[i]]);
  }

  void NoteSeam(const std::uint32_t* ids, std::size_t side,
                std::map<std::uint32_t, std::array<std::vector<Simplex>, 2>>* seams) {
    if (std::none_of(ids, ids + kWidth, [&](std::uint32_t p) { return number_[p] == kNone; }))
      return;
    Simplex s;
    std::copy_n(ids, kWidth, s.begin());
    (*seams)[PartOf(ids)][side].push_back(s);
  }

  const Simplices &before_, &after_;
  std::vector<std::uint32_t> number_;   // by point: among the changed ones, or kNone
  std::vector<std::uint32_t> up_;       // by changed point: towards the first of its part
  std::vector<std::size_t> old_, new_;  // where simplices that touch changed points begin
  std::vector<std::uint8_t> fits_;      // by part's first point
};

// Builds the stars of `deciding`, and takes over the mesh on the points `changed` where it has no
// cavity and fits to what is around. Returns the points where it did.
template <int K>
std::vector<std::uint32_t> Assembler<K>::Replace(std::vector<std::uint32_t> changed,
                                                 std::vector<std::uint32_t> deciding,
                                                 const std::vector<double>* weights) {
  const TiledStars stars =
      BuildTiledStars<K>(cloud_, {.ids = deciding, .weights = weights, .spacing = spacing_});
  PartExchange<K> exchange(changed, cloud_.size, result_.simplices, stars.simplices);
  for (const std::uint32_t p : stars.unfilled) exchange.Refuse(p);
  result_.simplices = exchange.Result();
  std::erase_if(changed, [&](std::uint32_t p) { return !exchange.Takes(p); });
  std::vector<std::uint32_t> left;
  std::set_difference(left_.begin(), left_.end(), changed.begin(), changed.end(),
                      std::back_inserter(left));
  left_ = std::move(left);
  for (const std::uint32_t p : changed) {
    if (result_.places[p] == Place::kDropped) continue;
    const bool weighted = weights && (*weights)[p] > 0;
    const bool tiled = std::binary_search(stars.tiled.begin(), stars.tiled.end(), p);
    if (p < own_)
      result_.places[p] = weighted ? Place::kWeighted : tiled ? Place::kTiled : Place::kOk;
    const auto at = std::lower_bound(deciding.begin(), deciding.end(), p) - deciding.begin();
    result_.radii[p] = stars.radii[static_cast<std::size_t>(at)];
  }
  return changed;
}

}  // namespace

template <int K>
Assembly Assemble(FittedCloud* cloud, const AssemblyRequest& request,
                  FunctionRef<void(double)> done) {
  return Assembler<K>(cloud, request).Run(done);
}

template Assembly Assemble<1>(FittedCloud*, const AssemblyRequest&, FunctionRef<void(double)>);
template Assembly Assemble<2>(FittedCloud*, const AssemblyRequest&, FunctionRef<void(double)>);
template Assembly Assemble<3>(FittedCloud*, const AssemblyRequest&, FunctionRef<void(double)>);

}  // namespace stellate::core
