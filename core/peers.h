#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace stellate::core {

// The parts that make one mesh together, in one process or in many. All functions wait for the
// other parts: all parts make the same calls in the same order, and so none inside a parallel
// loop.
//
//   const std::vector<Peers::Bytes> all = peers.ToAll(message);  // all[peers.part()] is our own
//   const Peers::Sums sums = peers.Sum(own.size());
//   const std::uint64_t first = sums.before;  // our things are numbered from this on
//
// core/base/parcel.h packs numbers into bytes.
class Peers {
 public:
  using Bytes = std::vector<std::byte>;

  virtual ~Peers() = default;

  // This part's number, from 0 to parts() - 1; and how many parts there are.
  virtual int part() const = 0;
  virtual int parts() const = 0;

  // Sends each part its bytes, by part. Returns those that each has sent to this one, by part.
  virtual std::vector<Bytes> Exchange(std::vector<Bytes> bytes) const = 0;
  // Sends all parts the same bytes. Returns those of each, by part, its own among them.
  virtual std::vector<Bytes> ToAll(Bytes bytes) const {
    std::vector<Bytes> all(static_cast<std::size_t>(parts()) - 1, bytes);
    all.push_back(std::move(bytes));
    return Exchange(std::move(all));
  }
  // Returns the sum over all parts, and over those before this one.
  struct Sums {
    std::uint64_t all, before;
  };
  virtual Sums Sum(std::uint64_t count) const = 0;
};

// The only part, of a whole mesh: it waits for nothing.
class Alone final : public Peers {
 public:
  int part() const override { return 0; }
  int parts() const override { return 1; }
  std::vector<Bytes> Exchange(std::vector<Bytes> bytes) const override { return bytes; }
  Sums Sum(std::uint64_t count) const override { return {count, 0}; }
};

// Returns the peers of a mesh that is made in one part; good for the life of the program.
inline const Peers& NoPeers() {
  static const Alone alone;
  return alone;
}

}  // namespace stellate::core
