#include "server/watch_log.h"

#include <algorithm>
#include <limits>

#include "core/message.h"

namespace stellate::server {
namespace {

using core::Status;
using core::StatusCode;

// Stands for a row that is looked up but not stored.
constexpr std::uint32_t kProbe = std::numeric_limits<std::uint32_t>::max();
// Simplices looked at for one part: bounds the time spent under the lock.
constexpr std::size_t kScanLimit = std::size_t{1} << 18;

Status OutOfStep(std::string message) {
  return {StatusCode::kFailedPrecondition, std::move(message)};
}

}  // namespace

WatchLog::WatchLog(int dimension, int ambient_dimension)
    : row_size_(static_cast<std::size_t>(dimension) + 1),
      d_(ambient_dimension),
      marks_(1),
      alive_(0, RowHash{this}, RowEqual{this}) {}

std::size_t WatchLog::RowHash::operator()(std::uint32_t simplex) const {
  std::uint64_t hash = 0x9e3779b97f4a7c15u;
  for (std::size_t i = 0; i < log->row_size_; ++i) {
    const std::uint32_t id =
        simplex == kProbe ? log->probe_[i] : log->rows_[simplex * log->row_size_ + i];
    hash = (hash ^ id) * 0xff51afd7ed558ccdu;
    hash ^= hash >> 32;
  }
  return hash;
}

bool WatchLog::RowEqual::operator()(std::uint32_t a, std::uint32_t b) const {
  if (a == b) return true;
  for (std::size_t i = 0; i < log->row_size_; ++i) {
    const auto id = [&](std::uint32_t s) {
      return s == kProbe ? log->probe_[i] : log->rows_[s * log->row_size_ + i];
    };
    if (id(a) != id(b)) return false;
  }
  return true;
}

Status WatchLog::Append(const core::MeshDelta& delta) {
  // The appending thread alone writes, so it reads without the lock.
  const std::uint64_t revision = marks_.size();
  const Mark& last = marks_.back();
  if (delta.revision != revision) {
    return OutOfStep(core::Message("a change leads to revision ", delta.revision, " but ", revision,
                                   " is the next"));
  }
  const auto new_vertices = static_cast<std::size_t>(delta.points.cols());
  if (new_vertices > 0 && delta.first_vertex != last.vertices) {
    return OutOfStep(core::Message("new vertices start at ", delta.first_vertex, " but ",
                                   last.vertices, " is the next id"));
  }
  const std::size_t first_simplex = last.simplices;
  const std::size_t new_simplices = delta.added.size() / row_size_;
  if (first_simplex + new_simplices >= kProbe) {
    return OutOfStep(core::Message("the mesh has had ", first_simplex + new_simplices,
                                   " simplices, more than the log can number"));
  }
  std::vector<std::uint32_t> dying;
  for (std::size_t r = 0; r + row_size_ <= delta.removed.size(); r += row_size_) {
    probe_ = delta.removed.data() + r;
    const auto it = alive_.find(kProbe);
    if (it == alive_.end()) {
      for (const std::uint32_t simplex : dying) alive_.insert(simplex);
      return OutOfStep(
          core::Message("revision ", revision, " removes a simplex that is not there"));
    }
    dying.push_back(*it);
    alive_.erase(it);
  }
  {
    const std::lock_guard lock(mutex_);
    for (const std::uint32_t simplex : dying) {
      lives_[simplex].died = revision;
      deaths_.PushBack(simplex);
    }
    const double* coordinates = delta.points.data();
    for (std::size_t i = 0; i < new_vertices * d_; ++i) points_.PushBack(coordinates[i]);
    for (std::size_t i = 0; i < new_simplices * row_size_; ++i) rows_.PushBack(delta.added[i]);
    for (std::size_t i = 0; i < new_simplices; ++i) lives_.PushBack({revision, 0});
    marks_.push_back({last.vertices + new_vertices, first_simplex + new_simplices, deaths_.size()});
  }
  for (std::size_t i = 0; i < new_simplices; ++i) {
    alive_.insert(static_cast<std::uint32_t>(first_simplex + i));
  }
  return Status::Ok();
}

std::uint64_t WatchLog::revision() const {
  const std::lock_guard lock(mutex_);
  return marks_.size() - 1;
}

WatchLog::Cursor WatchLog::Begin(std::uint64_t from) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[from];
  return {from, marks_.size() - 1, mark.deaths, mark.vertices, mark.simplices};
}

std::uint64_t WatchLog::MemoryBytes() const {
  constexpr std::uint64_t kAliveBytes = 40;  // a node of the set and its part of the table
  const std::lock_guard lock(mutex_);
  const Mark& end = marks_.back();
  return points_.size() * sizeof(double) + rows_.size() * sizeof(std::uint32_t) +
         lives_.size() * sizeof(Life) + deaths_.size() * sizeof(std::uint32_t) +
         marks_.size() * sizeof(Mark) + (end.simplices - end.deaths) * kAliveBytes;
}

WatchLog::Snapshot WatchLog::At(std::uint64_t revision) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[revision];
  return {mark.vertices, mark.simplices - mark.deaths, mark.vertices + mark.simplices};
}

WatchLog::Cursor WatchLog::BeginAt(std::uint64_t revision, std::uint64_t position) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[revision];
  const std::size_t vertex = std::min<std::size_t>(position, mark.vertices);
  // Nothing was there at revision 0, so nothing goes.
  return {0, revision, mark.deaths, vertex, position - vertex};
}

void WatchLog::CopyRow(std::uint32_t simplex, std::vector<std::uint32_t>* out) const {
  for (std::size_t i = 0; i < row_size_; ++i) out->push_back(rows_[simplex * row_size_ + i]);
}

DeltaPart WatchLog::Next(Cursor* cursor, std::size_t max_bytes) const {
  const std::size_t row_bytes = row_size_ * sizeof(std::uint32_t);
  const std::size_t max_rows = std::max<std::size_t>(max_bytes / row_bytes, 1);
  const std::size_t max_points = std::max<std::size_t>(max_bytes / (d_ * sizeof(double)), 1);
  DeltaPart part;
  part.revision = cursor->to;
  std::size_t scanned = 0;

  const std::lock_guard lock(mutex_);
  const Mark& end = marks_[cursor->to];
  // Gone: was there at `from`, is not at `to`. Deaths are in order, so those up to `to` suffice.
  for (; cursor->removed < end.deaths && scanned < kScanLimit; ++cursor->removed, ++scanned) {
    const std::uint32_t simplex = deaths_[cursor->removed];
    if (lives_[simplex].born > cursor->from) continue;
    if (part.removed.size() >= max_rows * row_size_) break;
    CopyRow(simplex, &part.removed);
  }
  if (cursor->removed < end.deaths || !part.removed.empty()) {
    part.first_vertex = cursor->vertex;
    part.complete = cursor->removed == end.deaths && cursor->vertex == end.vertices &&
                    cursor->added == end.simplices;
    return part;
  }
  part.first_vertex = cursor->vertex;
  const std::size_t points = std::min(end.vertices - cursor->vertex, max_points);
  part.points.reserve(points * d_);
  for (std::size_t i = 0; i < points * d_; ++i) {
    part.points.push_back(points_[cursor->vertex * d_ + i]);
  }
  cursor->vertex += points;
  if (cursor->vertex < end.vertices) return part;  // a position is among vertices or simplices
  const std::size_t bytes_left = max_bytes - std::min(max_bytes, points * d_ * sizeof(double));
  std::size_t rows_left = points == 0 ? max_rows : bytes_left / row_bytes;
  for (; cursor->added < end.simplices && scanned < kScanLimit; ++cursor->added, ++scanned) {
    const auto simplex = static_cast<std::uint32_t>(cursor->added);
    const Life& life = lives_[simplex];
    if (life.died != 0 && life.died <= cursor->to) continue;
    if (part.added.size() >= rows_left * row_size_) break;
    CopyRow(simplex, &part.added);
  }
  part.complete = cursor->vertex == end.vertices && cursor->added == end.simplices;
  return part;
}

}  // namespace stellate::server
