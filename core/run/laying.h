#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"
#include "core/refinement/surrogate.h"

namespace stellate::core {

// How a sample is laid at its final spacing before there is any star. Whoever drives it asks what
// Next says, and hands over the answers, until there is nothing more to ask.
template <int K>
class Laying {
 public:
  virtual ~Laying() = default;
  Laying(const Laying&) = delete;
  Laying& operator=(const Laying&) = delete;

  // Begins from those of the seeds that were found. Returns which of them joined the sample.
  virtual std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) = 0;

  // What to ask next; empty when the sample is laid, as far as it can be. round: whatever
  // Engine::Draw would be given.
  virtual CandidateSet<K> Next(std::uint64_t round) = 0;
  // Takes the answers. Returns which of them joined the sample.
  virtual std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                         const AnsweredPoints& answers) = 0;
  // Whose stars what was asked last is about.
  virtual const Engine<K>& asking() const = 0;

  // What it went by, for what is left to refine; or null. Lasts as long as this.
  virtual Surrogate<K>* guess() { return nullptr; }

  // About how many points are still to come.
  virtual double CountMissing() const = 0;

 protected:
  Laying() = default;
};

// How a run lays its sample: ahead, if that is asked for, k < 4 and the sample is not too large for
// it, else ring by ring. With walls, once their faces are meshed: the interior, of a domain of R^k
// at once. Null where it does not: where sizes are estimated, or given and asked for ahead; between
// walls where sizes are graded, where it would ask ahead, and from k = 4 on; elsewhere where what
// was found of the seeds is dense (a sample itself, or much of what so coarse a mesh needs). The
// engine is borrowed; `spec` is its.
template <int K>
std::unique_ptr<Laying<K>> LayingFor(Engine<K>& engine, const Specification& spec,
                                     const AnsweredPoints& seeds);

// Adds columns of the answers to the sample, as long as there is room in it. Returns which columns
// were added.
template <int K>
std::vector<std::uint8_t> LayColumns(Engine<K>& engine, const AnsweredPoints& answers,
                                     const std::vector<Eigen::Index>& columns);

// The lattice's nearest-neighbour distance for circumradii of epsilon, length.
double LaidSpacing(int k, double epsilon);
// Patches of it begin about so many spacings apart: nearer, and seams between them cost more
// vertices; farther, and the strain within them does.
inline constexpr double kPatchesApart = 10;

// How many points at most are grown before anybody is asked for one, and then asked for at once.
std::uint64_t MostAtOnce(int k, int d);

// The points' sizes in epsilon, where they are graded and given; else empty.
template <int K>
Eigen::VectorXd SharesOf(const SizeField<K>& sizes, const AnsweredPoints& answers);

// How many of the first `most` points that were found, in their order, lie `apart`, or their share
// of it, from all that were counted before.
std::size_t CountApart(const AnsweredPoints& from, Eigen::Index most, double apart,
                       const Eigen::VectorXd& shares = {});

}  // namespace stellate::core
