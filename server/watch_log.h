#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_set>
#include <vector>

#include "core/report.h"
#include "core/status.h"

namespace stellate::server {

// An array that only grows, in blocks that never move: appending is cheap whatever the size.
template <typename T>
class GrowingArray {
 public:
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return blocks_[i / kBlock][i % kBlock]; }
  const T& operator[](std::size_t i) const { return blocks_[i / kBlock][i % kBlock]; }
  void PushBack(T value) {
    if (size_ % kBlock == 0) blocks_.push_back(std::make_unique<T[]>(kBlock));
    blocks_[size_ / kBlock][size_ % kBlock] = value;
    ++size_;
  }

 private:
  static constexpr std::size_t kBlock = std::size_t{1} << 14;
  std::vector<std::unique_ptr<T[]>> blocks_;
  std::size_t size_ = 0;
};

// A part of the change between two revisions.
struct DeltaPart {
  std::uint64_t revision = 0;  // where the change leads
  std::uint64_t first_vertex = 0;
  std::vector<double> points;                 // d each
  std::vector<std::uint32_t> added, removed;  // k+1 each; never both in one part
  bool complete = false;                      // the last part
};

// The history of a mesh, from which the change from any revision to any later one is read in
// parts. Nothing is queued for a watcher: however slow, it costs a cursor, and several rounds
// reach it merged. What is kept is each vertex once and each simplex once, with the revisions in
// which it came and went, so memory grows with the work done and not with watchers or time.
//
// One thread appends; any threads read. Readers wait at most for the copying-in of one round.
class WatchLog {
 public:
  WatchLog(int dimension, int ambient_dimension);

  // kFailedPrecondition, and no change, if the revision is not the next one, vertex ids leave a
  // gap, or a simplex goes that is not there.
  core::Status Append(const core::MeshDelta& delta);

  std::uint64_t revision() const;
  std::uint64_t MemoryBytes() const;  // about what it holds

  // Where a reader stands between two revisions.
  struct Cursor {
    std::uint64_t from = 0, to = 0;
    std::size_t removed = 0, vertex = 0, added = 0;  // next to look at

    std::uint64_t Position() const { return vertex + added; }
  };

  // From `from` to the newest revision; `from` must not lie beyond that.
  Cursor Begin(std::uint64_t from) const;
  // The next part, of about `max_bytes` at most: all removed simplices first, then vertices, then
  // added simplices. Looks at a bounded number of simplices, so a part may be small or empty.
  DeltaPart Next(Cursor* cursor, std::size_t max_bytes) const;

  // The mesh as it was at a revision, to be read from the start or from where a reader stopped.
  struct Snapshot {
    std::uint64_t vertices = 0, simplices = 0;
    std::uint64_t positions = 0;  // 0: the start; this: the end
  };
  // `revision` must not lie beyond the newest.
  Snapshot At(std::uint64_t revision) const;
  // `position` must not lie beyond At(revision).positions. The cursor's Position tells where the
  // next part begins.
  Cursor BeginAt(std::uint64_t revision, std::uint64_t position) const;

 private:
  struct Life {
    std::uint64_t born = 0;
    std::uint64_t died = 0;  // 0: alive
  };
  struct RowHash {
    const WatchLog* log;
    std::size_t operator()(std::uint32_t simplex) const;
  };
  struct RowEqual {
    const WatchLog* log;
    bool operator()(std::uint32_t a, std::uint32_t b) const;
  };
  using Rows = std::unordered_set<std::uint32_t, RowHash, RowEqual>;

  void CopyRow(std::uint32_t simplex, std::vector<std::uint32_t>* out) const;

  const std::size_t row_size_;  // k + 1
  const std::size_t d_;

  mutable std::mutex mutex_;
  GrowingArray<double> points_;
  GrowingArray<std::uint32_t> rows_;    // ids of each simplex that ever was
  GrowingArray<Life> lives_;            // by simplex
  GrowingArray<std::uint32_t> deaths_;  // simplices in the order in which they went
  struct Mark {
    std::size_t vertices = 0, simplices = 0, deaths = 0;
  };
  std::vector<Mark> marks_;  // sizes at each revision, 0 first

  // The appending thread's own: simplices alive now, found by their vertices.
  Rows alive_;
  const std::uint32_t* probe_ = nullptr;  // the row that kProbe stands for
};

}  // namespace stellate::server
