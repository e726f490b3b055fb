#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "stellate/error.h"
#include "stellate/mesh.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::client {

// The simplices of a mesh as they come and go. Memory is that of the most there were at a time.
class SimplexSet {
 public:
  virtual ~SimplexSet() = default;
  virtual std::size_t bytes() const = 0;
  // What is known of simplices besides their ids; null where it is not.
  struct Marks {
    const char* turned = nullptr;  // a bit for each, as Orientation has them
    const char* labels = nullptr;  // of each, as many bytes as MakeSimplexSet was given
  };
  // `count` simplices of k+1 uint32 each; `ids` need not be aligned. False, and the set is spoilt,
  // where a vertex is not below `vertices`.
  virtual bool Add(const char* ids, Eigen::Index count, std::uint64_t vertices,
                   const Marks& marks) = 0;
  // False, and the set is spoilt, where one is not there.
  virtual bool Remove(const char* ids, Eigen::Index count) = 0;
  // (k+1) x m, columns in ascending order, which of them are turned, and their labels, one column
  // after the other, where they have any; nothing where one is there twice.
  struct Simplices {
    SimplexMatrix columns;
    std::vector<std::uint8_t> turned, labels;
  };
  virtual std::optional<Simplices> Sorted() const = 0;
};

// Null unless 1 <= k <= kMaxSimplexDimension. `labels`: of each simplex, where there are any.
inline constexpr int kMaxSimplexDimension = 7;
std::unique_ptr<SimplexSet> MakeSimplexSet(int k, std::size_t labels);

// Puts a mesh together from WatchMesh streams. Chunks are kept until their revision is complete,
// so that what a broken stream leaves undone can be sent again from revision() on.
class DeltaMesh {
 public:
  // `k`: of its simplices. `boundary_only`: each of them has two labels. At most `most_bytes` of it
  // are in memory: half of what this machine has, unless it is said. Errors: a k that this client
  // cannot hold.
  static Expected<DeltaMesh> Create(int k, int d, bool boundary_only = false,
                                    std::size_t most_bytes = HalfOfTheMemory());

  // Takes the chunk's arrays. Errors: what does not follow on revision() and what came before, and
  // more than there is room for.
  Expected<void> Absorb(v1::DeltaChunk&& chunk);
  // The last complete revision; 0: none yet.
  std::uint64_t revision() const { return revision_; }
  // Drops everything: the server starts from the empty mesh.
  void Reset();
  // Takes a part of a download, which is never sent again. Errors: what does not follow on the
  // parts before it.
  Expected<void> Add(v1::DownloadMeshResponse&& part);
  // Takes a chunk of the orientation of the last revision. Errors: what does not follow.
  Expected<void> Orient(const v1::Orientation& chunk);
  // Of the parts so far.
  std::uint64_t vertices() const { return coordinates_.size() / static_cast<std::size_t>(d_); }
  std::uint64_t simplices() const { return parts_simplices_; }
  // Drops the chunks of a revision that was cut short.
  void ForgetPending() {
    pending_.clear();
    pending_bytes_ = 0;
  }

  // The mesh as of revision(). Errors: a simplex that was added twice, an orientation of fewer
  // simplices or of more.
  Expected<Mesh> Take() const;

 private:
  DeltaMesh(int k, int d, std::size_t labels, std::unique_ptr<SimplexSet> set,
            std::size_t most_bytes)
      : k_(k),
        d_(d),
        labels_per_simplex_(labels),
        most_bytes_(most_bytes),
        simplex_set_(std::move(set)) {}

  static std::size_t HalfOfTheMemory();
  // With so many bytes more, which have come.
  Expected<void> CheckRoom(std::size_t more) const;
  Expected<void> Apply(const v1::MeshDelta& delta, const char* turned = nullptr);
  Expected<void> NoteWalls(const v1::MeshDelta& delta);

  int k_, d_;
  std::size_t labels_per_simplex_;  // 1; 2 of the boundary alone
  std::size_t most_bytes_;
  std::uint64_t revision_ = 0;
  std::vector<v1::MeshDelta> pending_;
  std::size_t pending_bytes_ = 0;
  std::vector<double> coordinates_;  // of the vertices so far, one after another
  std::vector<std::pair<std::uint32_t, std::uint64_t>> boundary_;  // vertices, walls as bits
  std::unique_ptr<SimplexSet> simplex_set_;
  std::uint64_t parts_simplices_ = 0;
  std::optional<Orientation> orientation_;  // of a download without its bits, which the set has
};

}  // namespace stellate::client
