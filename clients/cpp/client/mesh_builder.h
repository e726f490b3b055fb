#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "stellate/error.h"
#include "stellate/mesh.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::client {

// Added and removed simplices as they come, and what is left of them at the end. Sorted now and
// then, so that memory stays proportional to the mesh and not to its history.
class SimplexLog {
 public:
  virtual ~SimplexLog() = default;
  // Ids of whole simplices, one after another.
  virtual void Append(const std::vector<std::uint32_t>& ids, bool removed) = 0;
  // (k+1) x m, columns in ascending order.
  virtual SimplexMatrix Take() = 0;
};

// Null unless 1 <= k <= kMaxSimplexDimension.
inline constexpr int kMaxSimplexDimension = 7;
std::unique_ptr<SimplexLog> MakeSimplexLog(int k);

// Puts a mesh together from a WatchMesh stream.
class MeshBuilder {
 public:
  // Errors: a k that this client cannot hold.
  static Expected<MeshBuilder> Create(int k, int d);

  Expected<void> Absorb(const v1::MeshDelta& delta);
  // The mesh so far. Errors: a simplex with a vertex that never came.
  Expected<Mesh> Take();

 private:
  MeshBuilder(int k, int d, std::unique_ptr<SimplexLog> log) : k_(k), d_(d), log_(std::move(log)) {}

  int k_, d_;
  std::vector<double> coordinates_;  // of the vertices so far, one after another
  std::unique_ptr<SimplexLog> log_;
};

}  // namespace stellate::client
