#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/orientation.h"
#include "core/report.h"
#include "core/status.h"

namespace stellate::server {

// Append-only rows of `width` numbers each, in blocks that never move: appending is cheap at any
// size, and each row is contiguous.
template <typename T>
class GrowingRows {
 public:
  explicit GrowingRows(std::size_t width)
      : width_(width),
        shift_(std::countr_zero(
            std::bit_floor(std::max(kBlockBytes / (width * sizeof(T)), std::size_t{1})))) {}

  std::size_t size() const { return size_; }
  std::size_t bytes() const {  // in memory
    return blocks_.size() * (RowsOfBlock() * width_ * sizeof(T) + sizeof(blocks_[0]));
  }
  T* operator[](std::size_t row) { return blocks_[row >> shift_].get() + Offset(row); }
  const T* operator[](std::size_t row) const { return blocks_[row >> shift_].get() + Offset(row); }
  // How many rows from `row` on are contiguous.
  std::size_t Run(std::size_t row) const {
    return std::min(size_ - row, RowsOfBlock() - (row & (RowsOfBlock() - 1)));
  }
  void Append(const T* rows, std::size_t count) {
    while (count > 0) {
      if (size_ >> shift_ == blocks_.size()) {
        blocks_.push_back(std::make_unique_for_overwrite<T[]>(RowsOfBlock() * width_));
      }
      const std::size_t place = size_ & (RowsOfBlock() - 1);
      const std::size_t fits = std::min(count, RowsOfBlock() - place);
      std::copy_n(rows, fits * width_, blocks_.back().get() + place * width_);
      size_ += fits;
      rows += fits * width_;
      count -= fits;
    }
  }

 private:
  static constexpr std::size_t kBlockBytes = std::size_t{1} << 14;  // about

  std::size_t RowsOfBlock() const { return std::size_t{1} << shift_; }
  std::size_t Offset(std::size_t row) const { return (row & (RowsOfBlock() - 1)) * width_; }

  std::size_t width_;
  int shift_;
  std::vector<std::unique_ptr<T[]>> blocks_;
  std::size_t size_ = 0;
};

// What became of the points of a reconstruction, all of them: a core::Place each, and the positions
// that the complex was built on, d x n, if they are others. Empty of other meshes.
struct PointPlaces {
  std::vector<std::uint8_t> codes;
  Eigen::MatrixXd smoothed;
};

// A part of the change from one revision to another.
struct DeltaPart {
  std::uint64_t revision = 0;  // where the change leads
  std::uint64_t first_vertex = 0;
  std::vector<double> points;                 // d each
  std::vector<std::uint32_t> added, removed;  // k+1 each; none is in both
  std::vector<std::int8_t> labels;            // of those added; empty without labels
  // The vertices among them that are on walls, and the walls of each.
  std::vector<std::uint32_t> boundary;
  std::vector<core::WallSet> walls;
  // Of the points, in a download of the end of a reconstruction: what became of each (core::Place),
  // and, if it is elsewhere, the position that the complex was built on, d each.
  std::vector<std::uint8_t> places;
  std::vector<double> smoothed;
  // Of `added`, whose rows are in lexicographic order then; where it is known.
  std::optional<core::Orientation> orientation;
  bool complete = false;  // the last part
};

// All revisions of a mesh. Read the change from any revision to any later one, in parts:
//
//   MeshHistory::Cursor cursor = history.Begin(seen);   // from revision `seen` to the newest
//   DeltaPart part;
//   do part = history.Next(&cursor, max_bytes); while (!part.complete);
//
// Nothing is queued for a watcher: a slow one costs a cursor, and receives several rounds merged.
// Each vertex and each simplex is stored once, with the revisions at which it was added and
// removed, so memory grows with the work done, not with watchers or time.
//
// One thread appends; any threads read. Readers wait at most while one round is copied in.
class MeshHistory {
 public:
  // dimension  of the simplices
  // labels     how many each simplex has, if any: 1, or 2 of the boundary alone
  MeshHistory(int dimension, int ambient_dimension, int labels = 1);

  // Adds a revision; the last of a reconstruction has places. kFailedPrecondition, and no change,
  // if it is not the next one, vertex ids leave a gap, a removed simplex does not exist, or places
  // are not those of all vertices.
  core::Status Append(const core::MeshDelta& delta, const PointPlaces& places = {});

  // Finds the orientation of the newest revision, which is the last: nothing can be appended then.
  // The appending thread calls this, as work that can be interrupted (core/base/interruption.h),
  // and then nothing has changed. REQUIRES: no Orient before.
  void Orient();
  // The orientation of the newest revision; none: not known.
  std::optional<core::Orientation> orientation() const;

  // Writes everything as bytes, little-endian, in pieces. Returns false if `write` did. REQUIRES:
  // no Append at the same time.
  using Sink = std::function<bool(const void* data, std::size_t bytes)>;
  bool Write(const Sink& write) const;
  // Reads back what Write wrote; `read` returns the next bytes, or false if there are no more. The
  // result cannot be appended to. kFailedPrecondition: the bytes are not a history.
  using Source = std::function<bool(void* data, std::size_t bytes)>;
  static core::Expected<std::unique_ptr<MeshHistory>> Read(int dimension, int ambient_dimension,
                                                           const Source& read, int labels = 1);

  std::uint64_t revision() const;
  std::uint64_t MemoryBytes() const;  // that it occupies

  // The position of a reader between two revisions.
  struct Cursor {
    std::uint64_t from = 0, to = 0;
    std::size_t removed = 0, vertex = 0, added = 0;  // next to look at
    bool has_places = false;                         // parts have places
    // Simplices are read in lexicographic order, with their orientation, `added` counting those
    // that are there. Else `added` counts all that there were, `unsorted` in number.
    bool is_sorted = false;
    std::size_t unsorted = 0;

    std::uint64_t Position() const { return vertex + added + (added > 0 ? unsorted : 0); }
  };

  // Reads from `from` to the newest revision. REQUIRES: `from` is not later than that.
  Cursor Begin(std::uint64_t from) const;
  // Returns the next part, of `max_bytes` at most: all removed simplices first, then vertices, then
  // added simplices. Visits a bounded number of simplices, so a part may be small or empty.
  DeltaPart Next(Cursor* cursor, std::size_t max_bytes) const;

  // The size of the mesh at a revision. BeginAt reads it from the start, or from a position.
  struct Snapshot {
    std::uint64_t vertices = 0, simplices = 0;
    std::uint64_t positions = 0;       // 0: the start; this: the last that there is
    std::uint64_t most_positions = 0;  // that there are once it is oriented, if this is the last
  };
  // REQUIRES: `revision` is not later than the newest.
  Snapshot At(std::uint64_t revision) const;
  // Of the last revision, once it is oriented, simplices come in lexicographic order; but what was
  // begun before goes on as it began. REQUIRES: `position` is at most At(revision).positions.
  // Cursor::Position is where the next part begins.
  Cursor BeginAt(std::uint64_t revision, std::uint64_t position) const;

 private:
  bool ReadRows(const Source& read);
  bool WriteWalls(const Sink& write) const;
  bool ReadWalls(const Source& read);
  bool WriteOrientation(const Sink& write) const;
  bool ReadOrientation(const Source& read);
  std::vector<std::uint32_t> SortLiving() const;
  core::Orientation OrientationOf(const std::vector<std::uint32_t>& living) const;
  bool WriteLabels(const Sink& write) const;
  bool ReadLabels(const Source& read);
  bool WritePlaces(const Sink& write) const;
  bool ReadPlaces(const Source& read);
  void AppendPlaces(std::uint64_t end, DeltaPart* part) const;
  bool ComputeLives();
  static constexpr std::uint32_t kDead = std::uint32_t{1} << 31;
  // At which revision; 0: it is alive.
  std::uint32_t DiedAt(std::size_t simplex) const {
    const std::uint32_t life = *lives_[simplex];
    return life >= kDead ? life - kDead : 0;
  }
  std::uint32_t Unlink(const std::uint32_t* row);
  void Link(std::uint32_t simplex);
  bool IsSorted(std::uint64_t revision) const;
  void AppendRow(std::uint32_t simplex, DeltaPart* part) const;
  void AppendAdded(Cursor* cursor, std::size_t end, std::size_t max_rows, DeltaPart* part) const;
  void AppendSorted(Cursor* cursor, std::size_t max_rows, DeltaPart* part) const;

  const std::size_t row_size_;  // the simplices' dimension, and one
  const std::size_t d_;
  const std::size_t label_count_;  // of a simplex

  mutable std::mutex mutex_;
  GrowingRows<double> points_;
  struct OnWalls {
    std::uint64_t vertex = 0;
    core::WallSet walls = 0;
  };
  std::vector<OnWalls> boundary_;  // of the vertices, ascending
  // By vertex, of a reconstruction that is over; else empty. smoothed_: of no or of all vertices.
  std::vector<std::uint8_t> places_;
  GrowingRows<double> smoothed_;
  GrowingRows<std::uint32_t> rows_;  // ids of every simplex so far
  // By simplex: the next in its list, or once it is removed kDead and the revision at which it was.
  GrowingRows<std::uint32_t> lives_;
  GrowingRows<std::int8_t> labels_;    // by simplex, where it has any; else empty
  GrowingRows<std::uint32_t> deaths_;  // simplices in the order of their removal
  struct Mark {
    std::uint64_t vertices = 0, simplices = 0, deaths = 0;
  };
  std::vector<Mark> marks_;  // sizes at each revision, 0 first
  bool complete_ = false;    // nothing can be appended
  // Of the newest revision, once that is the last; and its simplices in lexicographic order.
  std::optional<core::Orientation> orientation_;
  std::vector<std::uint32_t> sorted_;

  // Until the last revision: the simplices of the newest one, in a list for each vertex, by their
  // lowest vertex. A list is at most as long as a star.
  GrowingRows<std::uint32_t> first_of_;  // by vertex
};

}  // namespace stellate::server
