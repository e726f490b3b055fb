#include "mpi_peers.h"

#include <sched.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <numeric>
#include <utility>

namespace stellate::mpi {
namespace {

// MPI counts by int: more goes in several messages.
constexpr std::size_t kMostAtOnce = std::size_t{1} << 30;

template <typename Send>
void InPieces(std::size_t size, const Send& send) {
  for (std::size_t at = 0; at < size; at += kMostAtOnce)
    send(at, static_cast<int>(std::min(kMostAtOnce, size - at)));
}

}  // namespace

MpiPeers::MpiPeers(MPI_Comm comm) {
  MPI_Comm_dup(comm, &comm_);
  MPI_Comm_rank(comm_, &part_);
  MPI_Comm_size(comm_, &parts_);
}

MpiPeers::~MpiPeers() { MPI_Comm_free(&comm_); }

std::vector<MpiPeers::Bytes> MpiPeers::Exchange(std::vector<Bytes> bytes) const {
  const auto parts = static_cast<std::size_t>(parts_), here = static_cast<std::size_t>(part_);
  std::vector<std::uint64_t> sizes(parts), coming(parts);
  for (std::size_t part = 0; part < parts; ++part) sizes[part] = bytes[part].size();
  MPI_Alltoall(sizes.data(), 1, MPI_UINT64_T, coming.data(), 1, MPI_UINT64_T, comm_);
  std::vector<Bytes> received(parts);
  received[here] = std::move(bytes[here]);
  std::vector<MPI_Request> requests;
  for (std::size_t part = 0; part < parts; ++part) {
    if (part == here) continue;
    received[part].resize(coming[part]);
    InPieces(coming[part], [&](std::size_t at, int count) {
      MPI_Irecv(received[part].data() + at, count, MPI_BYTE, static_cast<int>(part), 0, comm_,
                &requests.emplace_back());
    });
  }
  for (std::size_t part = 0; part < parts; ++part)
    if (part != here)
      InPieces(sizes[part], [&](std::size_t at, int count) {
        MPI_Isend(bytes[part].data() + at, count, MPI_BYTE, static_cast<int>(part), 0, comm_,
                  &requests.emplace_back());
      });
  MPI_Waitall(static_cast<int>(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
  return received;
}

std::vector<std::uint64_t> MpiPeers::SizesOf(std::uint64_t size) const {
  std::vector<std::uint64_t> sizes(static_cast<std::size_t>(parts_));
  MPI_Allgather(&size, 1, MPI_UINT64_T, sizes.data(), 1, MPI_UINT64_T, comm_);
  return sizes;
}

std::vector<MpiPeers::Bytes> MpiPeers::ToAll(Bytes bytes) const {
  const std::vector<std::uint64_t> sizes = SizesOf(bytes.size());
  std::vector<Bytes> received(sizes.size());
  for (std::size_t part = 0; part < sizes.size(); ++part) {
    const bool is_own = part == static_cast<std::size_t>(part_);
    if (is_own)
      received[part] = std::move(bytes);
    else
      received[part].resize(sizes[part]);
    InPieces(sizes[part], [&](std::size_t at, int count) {
      MPI_Bcast(received[part].data() + at, count, MPI_BYTE, static_cast<int>(part), comm_);
    });
  }
  return received;
}

MpiPeers::Sums MpiPeers::Sum(std::uint64_t count) const {
  const std::vector<std::uint64_t> counts = SizesOf(count);
  const auto before = counts.begin() + part_;
  const std::uint64_t none = 0;
  return {std::accumulate(counts.begin(), counts.end(), none),
          std::accumulate(counts.begin(), before, none)};
}

int ThreadsOfEach(MPI_Comm comm) {
  MPI_Comm machine = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
  int ranks = 1;
  MPI_Comm_size(machine, &ranks);
  cpu_set_t own;
  CPU_ZERO(&own);
  sched_getaffinity(0, sizeof own, &own);
  std::vector<cpu_set_t> all(static_cast<std::size_t>(ranks));
  MPI_Allgather(&own, sizeof own, MPI_BYTE, all.data(), sizeof own, MPI_BYTE, machine);
  MPI_Comm_free(&machine);
  const auto sharing = std::count_if(all.begin(), all.end(),
                                     [&](const cpu_set_t& its) { return CPU_EQUAL(&its, &own); });
  return std::max(1, CPU_COUNT(&own) / static_cast<int>(sharing));
}

}  // namespace stellate::mpi
