#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/parcel.h"
#include "core/peers.h"

namespace stellate::core {

// Work on many things that all parts know. Each part does a share, and sends the others what came
// of it. Things are dealt in stretches, so that neighbours are done together, and no part has all
// that is dear.
//
//   ShareOut(peers, count, 16, compute, pack, unpack);
//
// compute(i) does thing i, in parallel, as in ParallelFor. Then, one after the other, pack(i,
// &message) writes what came of it, and unpack(i, &parcel) takes that where another part did it.
// One part alone computes, and no more. REQUIRES: what comes of a thing depends on no other
// that is shared out with it.
template <typename Compute, typename PackOne, typename UnpackOne>
void ShareOut(const Peers& peers, std::size_t count, std::size_t stretch, const Compute& compute,
              const PackOne& pack, const UnpackOne& unpack) {
  if (peers.parts() == 1) return ParallelFor(count, compute);
  const auto parts = static_cast<std::size_t>(peers.parts());
  const auto things_of = [&](std::size_t part) {
    std::vector<std::size_t> things;
    for (std::size_t first = part * stretch; first < count; first += parts * stretch)
      for (std::size_t i = first; i < std::min(count, first + stretch); ++i) things.push_back(i);
    return things;
  };
  const auto here = static_cast<std::size_t>(peers.part());
  const std::vector<std::size_t> own = things_of(here);
  ParallelFor(own.size(), [&](std::size_t at) { compute(own[at]); });
  Peers::Bytes message;
  for (const std::size_t i : own) pack(i, &message);
  const std::vector<Peers::Bytes> all = peers.ToAll(std::move(message));
  for (std::size_t part = 0; part < parts; ++part) {
    if (part == here) continue;
    Parcel parcel(all[part]);
    for (const std::size_t i : things_of(part)) unpack(i, &parcel);
  }
}

// The same where compute(i) writes results[i], which are numbers.
template <typename Result, typename Compute>
void ShareOut(const Peers& peers, std::span<Result> results, std::size_t stretch,
              const Compute& compute) {
  ShareOut(
      peers, results.size(), stretch, compute,
      [&](std::size_t i, Peers::Bytes* message) { Pack(results[i], message); },
      [&](std::size_t i, Parcel* parcel) { parcel->Unpack(1, &results[i]); });
}

}  // namespace stellate::core
