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

// Puts a mesh together from WatchMesh streams. Chunks are kept until their revision is complete,
// so that what a broken stream leaves undone can be sent again from revision() on.
class MeshBuilder {
 public:
  // Errors: a k that this client cannot hold.
  static Expected<MeshBuilder> Create(int k, int d);

  // Takes the chunk's arrays. Errors: what does not follow on revision() and what came before.
  Expected<void> Absorb(v1::DeltaChunk&& chunk);
  // The last complete revision; 0: none yet.
  std::uint64_t revision() const { return revision_; }
  // Drops everything: the server begins anew.
  void Reset();
  // Takes a part of a download, which is never sent again. Errors: what does not follow on the
  // parts before it.
  Expected<void> Add(v1::DownloadMeshResponse&& part);
  // Of the parts so far.
  std::uint64_t vertices() const { return coordinates_.size() / static_cast<std::size_t>(d_); }
  std::uint64_t simplices() const { return parts_simplices_; }
  // Drops the chunks of a revision that was cut short.
  void ForgetPending() { pending_.clear(); }

  // The mesh as of revision(). Errors: a simplex with a vertex that never came.
  Expected<Mesh> Take();

 private:
  MeshBuilder(int k, int d, std::unique_ptr<SimplexLog> log) : k_(k), d_(d), log_(std::move(log)) {}

  Expected<void> Apply(const v1::MeshDelta& delta);

  int k_, d_;
  std::uint64_t revision_ = 0;
  std::vector<v1::MeshDelta> pending_;
  std::vector<double> coordinates_;  // of the vertices so far, one after another
  std::unique_ptr<SimplexLog> log_;
  std::uint64_t parts_simplices_ = 0;
};

}  // namespace stellate::client
