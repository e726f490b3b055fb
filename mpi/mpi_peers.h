#pragma once

#include <mpi.h>

#include <cstdint>
#include <vector>

#include "core/peers.h"

namespace stellate::mpi {

// The ranks of a communicator. Where one is lost, or MPI fails, all of them end: MPI's own default.
class MpiPeers final : public core::Peers {
 public:
  // Uses a copy of `comm`, so that no message of others comes between. All ranks of it make one,
  // and it goes before MPI_Finalize.
  explicit MpiPeers(MPI_Comm comm);
  ~MpiPeers() override;
  MpiPeers(const MpiPeers&) = delete;
  MpiPeers& operator=(const MpiPeers&) = delete;

  int part() const override { return part_; }
  int parts() const override { return parts_; }
  std::vector<Bytes> Exchange(std::vector<Bytes> bytes) const override;
  std::vector<Bytes> ToAll(Bytes bytes) const override;
  Sums Sum(std::uint64_t count) const override;

 private:
  std::vector<std::uint64_t> SizesOf(std::uint64_t size) const;

  MPI_Comm comm_ = MPI_COMM_NULL;
  int part_ = 0, parts_ = 1;
};

// How many threads each rank of `comm` may compute with, so that those that share processors share
// them evenly. All ranks call it; 1 at least.
int ThreadsOfEach(MPI_Comm comm);

}  // namespace stellate::mpi
