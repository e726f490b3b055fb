#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/refinement/engine.h"
#include "core/refinement/independent_set.h"
#include "core/run/round_trip.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core::testing {

// R^d cut into cubes that are dealt out to parts: whatever lies in a part's cubes is its own.
class Cubes {
 public:
  // edge: length. `along`: only so many first coordinates tell, so that cubes are bars or slabs.
  Cubes(int parts, double edge, int along) : parts_(parts), edge_(edge), along_(along) {}

  int parts() const { return parts_; }
  int OwnerOf(const double* point) const {
    std::vector<std::int64_t> cube;
    for (int i = 0; i < along_; ++i) cube.push_back(CubeOf(point[i]));
    return OwnerOf(cube);
  }
  // Whether the point lies within `halo` of a cube of that part. REQUIRES: halo <= edge
  bool IsNear(int part, const double* point, double halo) const {
    std::vector<std::int64_t> cube(static_cast<std::size_t>(along_));
    return IsNear(part, point, halo * halo, 0, &cube);
  }

 private:
  std::int64_t CubeOf(double x) const { return static_cast<std::int64_t>(std::floor(x / edge_)); }
  int OwnerOf(const std::vector<std::int64_t>& cube) const {
    std::uint64_t mixed = 1;
    for (const std::int64_t i : cube) mixed = Mix64(mixed ^ static_cast<std::uint64_t>(i));
    return static_cast<int>(mixed % static_cast<std::uint64_t>(parts_));
  }
  bool IsNear(int part, const double* point, double left2, int axis,
              std::vector<std::int64_t>* cube) const {
    if (axis == along_) return OwnerOf(*cube) == part;
    const std::int64_t here = CubeOf(point[axis]);
    for (const std::int64_t at : {here, here - 1, here + 1}) {
      const double lower = static_cast<double>(at) * edge_;
      const double off = std::max({lower - point[axis], point[axis] - lower - edge_, 0.0});
      if (off * off > left2) continue;
      (*cube)[static_cast<std::size_t>(axis)] = at;
      if (IsNear(part, point, left2 - off * off, axis + 1, cube)) return true;
    }
    return false;
  }

  int parts_;
  double edge_;
  int along_;
};

// An initial sample, refined by several parts. Each has an engine of its own, which knows what lies
// in its cubes and within a halo of them, and nothing else; of what it finds only that is heeded
// which is about its own stars. Between them go the round's targets, of which the independent set
// is chosen, whether points fell where they were aimed, and in the order of the round what became
// of each target: the messages that parts in many processes would send.
template <int K>
class PartedRun {
 public:
  PartedRun(const Specification& spec, Oracle& oracle, const Cubes& cubes, double halo)
      : spec_(spec),
        oracle_(oracle),
        cubes_(cubes),
        halo_(halo),
        criteria_(Resolve(spec)),
        finder_(K, spec.ambient_dimension, 0.01 * spec.epsilon, spec.random_seed) {
    for (int part = 0; part < cubes.parts(); ++part)
      parts_.push_back({std::make_unique<Engine<K>>(spec, criteria_), {}, {}, {}, {}});
  }

  // tangents: (K rows of d) x n.
  void Lay(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents) {
    AnsweredPoints sampled;
    sampled.points = points;
    sampled.tangents = tangents;
    for (Eigen::Index c = 0; c < points.cols(); ++c) {
      owner_.push_back(cubes_.OwnerOf(points.col(c).data()));
      for (int part = 0; part < cubes_.parts(); ++part) {
        if (!Knows(part, points.col(c).data())) continue;
        parts_[part].engine->AddToSample(sampled, c);
        Name(&parts_[part], static_cast<std::uint32_t>(c));
      }
    }
    for (Part& part : parts_) part.engine->Commit();
  }

  // From the round of that number on. What each round changes in the mesh is told.
  using Told = std::function<void(std::uint64_t round, std::vector<std::uint32_t> added,
                                  std::vector<std::uint32_t> removed)>;
  void Refine(std::uint64_t round, const Told& told) {
    while (true) {
      const std::vector<Seen> targets = Plan();
      if (targets.empty()) return;
      Draw(targets, round);
      round += Ask();
      Insert();
      std::vector<std::uint32_t> added, removed;
      for (int part = 0; part < cubes_.parts(); ++part) {
        const auto change = parts_[part].engine->Commit();
        KeepOwn(part, change.added, &added);
        KeepOwn(part, change.removed, &removed);
      }
      told(round, std::move(added), std::move(removed));
    }
  }

  std::uint32_t size() const { return static_cast<std::uint32_t>(owner_.size()); }
  // Of all points that each part knows, its own.
  double share_of_own() const {
    std::size_t known = 0;
    for (const Part& part : parts_) known += part.names.size();
    return static_cast<double>(size()) / static_cast<double>(known);
  }
  std::vector<std::uint32_t> Simplices() const {
    std::vector<std::uint32_t> all;
    for (int part = 0; part < cubes_.parts(); ++part)
      KeepOwn(part, parts_[part].engine->Simplices(), &all);
    return all;
  }
  std::vector<double> PointsByName() const {
    const auto d = static_cast<std::size_t>(spec_.ambient_dimension);
    std::vector<double> points(size() * d);
    for (int part = 0; part < cubes_.parts(); ++part)
      for (std::uint32_t i = 0; i < parts_[part].names.size(); ++i)
        if (IsOwn(part, i))
          std::copy_n(parts_[part].engine->stars().sample().Point(i), d,
                      points.data() + parts_[part].names[i] * d);
    return points;
  }
  const std::set<Rule>& rules() const { return rules_; }  // that had targets

 private:
  struct Part {
    std::unique_ptr<Engine<K>> engine;
    std::vector<std::uint32_t> names;  // by its own ids, ascending
    std::vector<Target<K>> targets;    // its own of the round
    std::unique_ptr<RoundTrip<K>> trip;
    std::unique_ptr<Inserter<K>> inserter;
  };
  struct Seen {
    int part;
    Target<K> target;
  };

  bool Knows(int part, const double* point) const { return cubes_.IsNear(part, point, halo_); }
  bool IsOwn(int part, std::uint32_t id) const { return owner_[parts_[part].names[id]] == part; }

  void Name(Part* part, std::uint32_t name) {
    part->engine->parts().stars.NameLast(name);
    part->names.push_back(name);
  }

  // By the first rules that any part's own stars break.
  std::vector<Seen> Plan() {
    std::vector<Seen> seen;
    const auto gather = [&](const auto& targets_of) {
      for (int part = 0; part < cubes_.parts(); ++part)
        for (const Target<K>& target : targets_of(*parts_[part].engine))
          if (IsOwn(part, target.star)) seen.push_back({part, target});
    };
    gather([](Engine<K>& engine) { return engine.SizeAndShapeTargets(); });
    if (seen.empty()) gather([](Engine<K>& engine) { return engine.GoodPointTargets(); });
    return seen;
  }

  void Draw(const std::vector<Seen>& seen, std::uint64_t round) {
    std::vector<Target<K>> named;
    std::vector<double> centres;
    for (const auto& [part, target] : seen) {
      const std::vector<double> centre =
          CentresOf<K>(parts_[part].engine->stars(), std::vector{target});
      centres.insert(centres.end(), centre.begin(), centre.end());
      named.push_back(target);
      named.back().star = parts_[part].names[target.star];
      rules_.insert(target.violation.rule);
    }
    order_.clear();
    for (Part& part : parts_) part.targets.clear();
    for (const std::size_t i :
         SelectIndependent<K>(spec_.ambient_dimension, centres, named, named.size())) {
      Part& part = parts_[seen[i].part];
      order_.emplace_back(seen[i].part, part.targets.size());
      part.targets.push_back(seen[i].target);
    }
    for (Part& part : parts_)
      part.trip = std::make_unique<RoundTrip<K>>(*part.engine, spec_.oracle, finder_,
                                                 part.engine->Draw(part.targets, round));
  }

  // Returns in how many batches.
  std::uint64_t Ask() {
    std::uint64_t batches = 0;
    for (Part& part : parts_) {
      std::uint64_t asked = 0;
      for (auto blocks = part.trip->Questions(); !blocks.empty(); blocks = part.trip->Questions()) {
        part.trip->Absorb(AnswersOf(oracle_, QueryBatch{0, std::move(blocks)}).blocks);
        ++asked;
      }
      batches = std::max(batches, asked);
    }
    return batches;
  }

  void Insert() {
    bool near = true;
    for (Part& part : parts_) {
      part.inserter = std::make_unique<Inserter<K>>(
          part.engine->InserterOf(part.trip->candidates(), part.trip->answers()));
      near = part.inserter->Judge() && near;
    }
    for (Part& part : parts_) part.inserter->SetAllNearTarget(near);
    for (const auto& [at, target] : order_) {
      Part& part = parts_[at];
      const std::uint32_t star = part.names[part.targets[target].star];
      switch (part.inserter->InsertTarget(target)) {
        case Inserter<K>::Outcome::kInserted:
          Tell(at);
          break;
        case Inserter<K>::Outcome::kFailed:
          TellFailed(at, star);
          break;
        case Inserter<K>::Outcome::kPutOff:
          break;
      }
    }
  }

  // What a part inserted last.
  void Tell(int from) {
    const Stars<K>& stars = parts_[from].engine->stars();
    const std::uint32_t last = stars.size() - 1, name = size();
    const int d = spec_.ambient_dimension;
    AnsweredPoints point;
    point.points = Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(last), d);
    point.tangents = Eigen::Map<const Eigen::VectorXd>(stars.sample().Tangent(last), d * K);
    owner_.push_back(cubes_.OwnerOf(stars.sample().Point(last)));
    for (int part = 0; part < cubes_.parts(); ++part) {
      if (part != from && !Knows(part, point.points.data())) continue;
      if (part != from) parts_[part].engine->Append(point, 0);
      Name(&parts_[part], name);
    }
  }

  void TellFailed(int from, std::uint32_t star) {
    for (int part = 0; part < cubes_.parts(); ++part) {
      const auto& names = parts_[part].names;
      const auto at = std::lower_bound(names.begin(), names.end(), star);
      if (part != from && at != names.end() && *at == star)
        parts_[part].engine->parts().violations.NoteFailedAttempt(
            static_cast<std::uint32_t>(at - names.begin()));
    }
  }

  // By name, of those that are held by its own stars.
  void KeepOwn(int part, const std::vector<std::uint32_t>& simplices,
               std::vector<std::uint32_t>* kept) const {
    for (std::size_t i = 0; i < simplices.size(); i += K + 1)
      if (IsOwn(part, simplices[i]))
        for (std::size_t s = i; s <= i + K; ++s) kept->push_back(parts_[part].names[simplices[s]]);
  }

  const Specification spec_;
  Oracle& oracle_;
  const Cubes cubes_;
  const double halo_;  // length
  const ResolvedCriteria criteria_;
  TangentFinder finder_;
  std::vector<Part> parts_;
  std::vector<int> owner_;                          // by name
  std::vector<std::pair<int, std::size_t>> order_;  // the round's targets: whose, and which of its
  std::set<Rule> rules_;
};

}  // namespace stellate::core::testing
