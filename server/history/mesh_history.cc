#include "server/history/mesh_history.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/parallel.h"

namespace stellate::server {
namespace {

using core::Status;
using core::StatusCode;

// The end of a list of simplices; numbers and revisions are below it.
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max() >> 1;
// Simplices looked at for one part: bounds the time spent under the lock.
constexpr std::size_t kScanLimit = std::size_t{1} << 18;

Status OutOfStep(std::string message) {
  return {StatusCode::kFailedPrecondition, std::move(message)};
}

template <typename T>
bool WriteRows(const GrowingRows<T>& rows, std::size_t width, const MeshHistory::Sink& write) {
  for (std::size_t row = 0; row < rows.size(); row += rows.Run(row)) {
    if (!write(rows[row], rows.Run(row) * width * sizeof(T))) return false;
  }
  return true;
}

// Takes memory only for what is there.
template <typename T>
bool ReadInto(GrowingRows<T>* rows, std::size_t width, std::uint64_t count,
              const MeshHistory::Source& read) {
  constexpr std::uint64_t kAtOnce = 4096;
  std::vector<T> some;
  for (std::uint64_t left = count; left > 0;) {
    const std::uint64_t take = std::min(left, kAtOnce);
    some.resize(take * width);
    if (!read(some.data(), some.size() * sizeof(T))) return false;
    rows->Append(some.data(), take);
    left -= take;
  }
  return true;
}

std::size_t BytesOfBits(std::size_t bits) { return (bits + 7) / 8; }
bool IsSet(const std::vector<std::uint8_t>& bits, std::size_t i) {
  return (bits[i / 8] >> (i % 8) & 1) != 0;
}
void Set(std::vector<std::uint8_t>* bits, std::size_t i) {
  (*bits)[i / 8] |= static_cast<std::uint8_t>(1u << (i % 8));
}

}  // namespace

MeshHistory::MeshHistory(int dimension, int ambient_dimension, int labels)
    : row_size_(static_cast<std::size_t>(dimension) + 1),
      d_(ambient_dimension),
      label_count_(static_cast<std::size_t>(labels)),
      points_(d_),
      smoothed_(d_),
      rows_(row_size_),
      lives_(1),
      labels_(label_count_),
      deaths_(1),
      marks_(1),
      first_of_(1) {}

// Takes a simplex from the living; kNone if it is not among them.
std::uint32_t MeshHistory::Unlink(const std::uint32_t* row) {
  if (row[0] >= first_of_.size()) return kNone;
  std::uint32_t* link = first_of_[row[0]];
  while (*link != kNone && !std::equal(row, row + row_size_, rows_[*link])) link = lives_[*link];
  const std::uint32_t simplex = *link;
  if (simplex != kNone) *link = *lives_[simplex];
  return simplex;
}

void MeshHistory::Link(std::uint32_t simplex) {
  std::uint32_t& first = *first_of_[*rows_[simplex]];
  *lives_[simplex] = first;
  first = simplex;
}

Status MeshHistory::Append(const core::MeshDelta& delta, const PointPlaces& places) {
  // The appending thread alone writes, so it reads without the lock.
  const std::uint64_t revision = marks_.size();
  const Mark& last = marks_.back();
  if (complete_) return OutOfStep("the mesh is over and changes no more");
  if (delta.revision != revision) {
    return OutOfStep(core::Message("a change leads to revision ", delta.revision, " but ", revision,
                                   " is the next"));
  }
  if (revision >= kNone) return OutOfStep("the mesh has had more revisions than can be numbered");
  const auto new_vertices = static_cast<std::size_t>(delta.points.cols());
  if (new_vertices > 0 && delta.first_vertex != last.vertices) {
    return OutOfStep(core::Message("new vertices start at ", delta.first_vertex, " but ",
                                   last.vertices, " is the next id"));
  }
  const std::size_t first_simplex = last.simplices;
  const std::size_t new_simplices = delta.added.size() / row_size_;
  if (first_simplex + new_simplices >= kNone) {
    return OutOfStep(core::Message("the mesh has had ", first_simplex + new_simplices,
                                   " simplices, more than a history can number"));
  }
  for (std::size_t i = 0; i < new_simplices; ++i) {
    if (delta.added[i * row_size_] < last.vertices + new_vertices) continue;
    return OutOfStep(core::Message("revision ", revision, " adds a simplex with vertex ",
                                   delta.added[i * row_size_], ", which is not there"));
  }
  const std::vector<std::uint32_t> no_lists(new_vertices, kNone);
  const std::lock_guard lock(mutex_);
  std::vector<std::uint32_t> dying;
  dying.reserve(delta.removed.size() / row_size_);
  for (std::size_t r = 0; r + row_size_ <= delta.removed.size(); r += row_size_) {
    const std::uint32_t simplex = Unlink(delta.removed.data() + r);
    if (simplex == kNone) {
      for (const std::uint32_t other : dying) Link(other);
      return OutOfStep(
          core::Message("revision ", revision, " removes a simplex that is not there"));
    }
    dying.push_back(simplex);
  }
  const std::size_t vertices = last.vertices + new_vertices;
  const auto smoothed = static_cast<std::size_t>(places.smoothed.cols());
  if ((!places.codes.empty() && places.codes.size() != vertices) ||
      (smoothed > 0 && smoothed != vertices)) {
    for (const std::uint32_t other : dying) Link(other);
    return OutOfStep(core::Message("revision ", revision, " tells the places of ",
                                   places.codes.size(), " points and the positions of ", smoothed,
                                   ", and has ", vertices));
  }
  for (const std::uint32_t simplex : dying)
    *lives_[simplex] = kDead + static_cast<std::uint32_t>(revision);
  deaths_.Append(dying.data(), dying.size());
  points_.Append(delta.points.data(), new_vertices);
  for (std::size_t v = 0; v < delta.walls.size(); ++v)
    if (delta.walls[v] != 0) boundary_.push_back({last.vertices + v, delta.walls[v]});
  rows_.Append(delta.added.data(), new_simplices);
  labels_.Append(delta.labels.data(), delta.labels.size() / label_count_);
  if (!places.codes.empty()) places_ = places.codes;
  smoothed_.Append(places.smoothed.data(), smoothed);
  first_of_.Append(no_lists.data(), new_vertices);
  lives_.Append(delta.added.data(), new_simplices);  // any numbers: Link sets them
  for (std::size_t i = 0; i < new_simplices; ++i)
    Link(static_cast<std::uint32_t>(first_simplex + i));
  marks_.push_back({last.vertices + new_vertices, first_simplex + new_simplices, deaths_.size()});
  return Status::Ok();
}

// The simplices of the newest revision, in lexicographic order of their rows.
std::vector<std::uint32_t> MeshHistory::SortLiving() const {
  std::vector<std::uint32_t> end(marks_.back().vertices + 1, 0);  // of those with a lowest vertex
  for (std::size_t s = 0; s < rows_.size(); ++s) {
    core::CheckInterruption(s);
    if (DiedAt(s) == 0) ++end[*rows_[s] + 1];
  }
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<std::uint32_t> living(end.back());
  for (std::size_t s = 0; s < rows_.size(); ++s) {
    core::CheckInterruption(s);
    if (DiedAt(s) == 0) living[end[*rows_[s]]++] = static_cast<std::uint32_t>(s);
  }
  core::ParallelFor(marks_.back().vertices, [&](std::size_t v) {
    const auto first = static_cast<std::ptrdiff_t>(v == 0 ? 0 : end[v - 1]);
    std::sort(living.begin() + first, living.begin() + end[v],
              [this](std::uint32_t a, std::uint32_t b) {
                return std::lexicographical_compare(rows_[a], rows_[a] + row_size_, rows_[b],
                                                    rows_[b] + row_size_);
              });
  });
  return living;
}

// Of the boundary of what fills space, labels tell: out of the larger one.
core::Orientation MeshHistory::OrientationOf(const std::vector<std::uint32_t>& living) const {
  if (label_count_ == 2 && row_size_ == d_) {
    core::Orientation orientation{true, std::vector<std::uint8_t>(BytesOfBits(living.size()), 0)};
    for (std::size_t i = 0; i < living.size(); ++i)
      if (labels_[living[i]][0] < labels_[living[i]][1]) Set(&orientation.turned, i);
    return orientation;
  }
  std::vector<std::uint32_t> rows(living.size() * row_size_);
  core::ParallelFor(living.size(), [&](std::size_t i) {
    std::copy_n(rows_[living[i]], row_size_, rows.data() + i * row_size_);
  });
  return core::Orient(static_cast<int>(row_size_) - 1, static_cast<int>(d_),
                      static_cast<std::uint32_t>(points_.size()), rows,
                      [this](std::uint32_t v) { return points_[v]; });
}

void MeshHistory::Orient() {
  std::vector<std::uint32_t> sorted = SortLiving();
  core::Orientation orientation = OrientationOf(sorted);
  const std::lock_guard lock(mutex_);
  complete_ = true;
  orientation_ = std::move(orientation);
  sorted_ = std::move(sorted);
  first_of_ = GrowingRows<std::uint32_t>(1);
}

std::optional<core::Orientation> MeshHistory::orientation() const {
  const std::lock_guard lock(mutex_);
  return orientation_;
}

bool MeshHistory::Write(const Sink& write) const {
  const std::uint64_t revisions = marks_.size() - 1;
  return write(&revisions, sizeof(revisions)) &&
         write(marks_.data() + 1, revisions * sizeof(Mark)) && WriteRows(points_, d_, write) &&
         WriteRows(rows_, row_size_, write) && WriteRows(deaths_, 1, write) && WriteWalls(write) &&
         WriteOrientation(write) && WritePlaces(write) && WriteLabels(write);
}

bool MeshHistory::WriteWalls(const Sink& write) const {
  const std::uint64_t count = boundary_.size();
  return write(&count, sizeof(count)) &&
         (count == 0 || write(boundary_.data(), boundary_.size() * sizeof(OnWalls)));
}

bool MeshHistory::ReadWalls(const Source& read) {
  std::uint64_t count = 0;
  const std::uint64_t vertices = marks_.back().vertices;
  if (!read(&count, sizeof(count)) || count > vertices) return false;
  for (std::uint64_t i = 0, next = 0; i < count; ++i) {
    OnWalls one;
    if (!read(&one, sizeof(one)) || one.vertex < next || one.vertex >= vertices) return false;
    next = one.vertex + 1;
    boundary_.push_back(one);
  }
  return true;
}

bool MeshHistory::WriteOrientation(const Sink& write) const {
  const std::uint8_t known = !orientation_ ? 0 : orientation_->orientable ? 2 : 1;
  if (!write(&known, sizeof(known))) return false;
  if (known < 2 || orientation_->turned.empty()) return true;
  return write(orientation_->turned.data(), orientation_->turned.size());
}

bool MeshHistory::ReadOrientation(const Source& read) {
  std::uint8_t known = 0;
  if (!read(&known, sizeof(known)) || known > 2) return false;
  if (known == 0) return true;
  orientation_.emplace();
  if (known == 1) return true;
  const Mark& end = marks_.back();
  orientation_->orientable = true;
  // No larger than the rows, which have been read.
  std::vector<std::uint8_t>& turned = orientation_->turned;
  turned.resize(BytesOfBits(end.simplices - std::min(end.deaths, end.simplices)));
  return turned.empty() || read(turned.data(), turned.size());
}

bool MeshHistory::WritePlaces(const Sink& write) const {
  const std::uint64_t counts[] = {places_.size(), smoothed_.size()};
  return write(counts, sizeof(counts)) &&
         (places_.empty() || write(places_.data(), places_.size())) &&
         WriteRows(smoothed_, d_, write);
}

bool MeshHistory::ReadPlaces(const Source& read) {
  std::uint64_t counts[2];
  const std::uint64_t vertices = marks_.back().vertices;
  if (!read(counts, sizeof(counts))) return false;
  for (const std::uint64_t count : counts)
    if (count != 0 && count != vertices) return false;
  places_.resize(counts[0]);  // no more than the points, which have been read
  return (places_.empty() || read(places_.data(), places_.size())) &&
         ReadInto(&smoothed_, d_, counts[1], read);
}

bool MeshHistory::WriteLabels(const Sink& write) const {
  return labels_.size() == 0 || WriteRows(labels_, label_count_, write);
}

bool MeshHistory::ReadLabels(const Source& read) {
  std::vector<std::int8_t> first(label_count_);
  const std::uint64_t simplices = marks_.back().simplices;
  if (simplices == 0 || !read(first.data(), first.size())) return true;
  labels_.Append(first.data(), 1);
  return ReadInto(&labels_, label_count_, simplices - 1, read);
}

core::Expected<std::unique_ptr<MeshHistory>> MeshHistory::Read(int dimension, int ambient_dimension,
                                                               const Source& read, int labels) {
  auto history = std::make_unique<MeshHistory>(dimension, ambient_dimension, labels);
  history->complete_ = true;
  if (!history->ReadRows(read) || !history->ComputeLives()) {
    return tl::unexpected(OutOfStep("these are not the bytes of a mesh's history"));
  }
  if (history->orientation_) history->sorted_ = history->SortLiving();
  return history;
}

bool MeshHistory::ReadRows(const Source& read) {
  std::uint64_t revisions = 0;
  if (!read(&revisions, sizeof(revisions))) return false;
  for (std::uint64_t revision = 1; revision <= revisions; ++revision) {
    const Mark last = marks_.back();
    Mark mark;
    if (!read(&mark, sizeof(mark)) || mark.vertices < last.vertices ||
        mark.simplices < last.simplices || mark.deaths < last.deaths) {
      return false;
    }
    marks_.push_back(mark);
  }
  const Mark& end = marks_.back();
  return revisions < kNone && end.vertices <= std::numeric_limits<std::uint32_t>::max() &&
         end.simplices < kNone && ReadInto(&points_, d_, end.vertices, read) &&
         ReadInto(&rows_, row_size_, end.simplices, read) &&
         ReadInto(&deaths_, 1, end.deaths, read) && ReadWalls(read) && ReadOrientation(read) &&
         ReadPlaces(read) && ReadLabels(read);
}

// From the order of births and deaths.
bool MeshHistory::ComputeLives() {
  for (std::uint64_t revision = 1; revision < marks_.size(); ++revision) {
    const Mark &from = marks_[revision - 1], &to = marks_[revision];
    for (std::uint64_t i = from.deaths; i < to.deaths; ++i) {
      const std::uint32_t simplex = *deaths_[i];
      if (simplex >= lives_.size() || DiedAt(simplex) != 0) return false;
      *lives_[simplex] = kDead + static_cast<std::uint32_t>(revision);
    }
    for (std::uint64_t simplex = from.simplices; simplex < to.simplices; ++simplex) {
      const std::uint32_t* const row = rows_[simplex];
      if (*std::max_element(row, row + row_size_) >= to.vertices) return false;
      lives_.Append(&kNone, 1);  // what is read back has no lists
    }
  }
  return true;
}

std::uint64_t MeshHistory::revision() const {
  const std::lock_guard lock(mutex_);
  return marks_.size() - 1;
}

MeshHistory::Cursor MeshHistory::Begin(std::uint64_t from) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[from];
  return {from, marks_.size() - 1, mark.deaths, mark.vertices, mark.simplices};
}

std::uint64_t MeshHistory::MemoryBytes() const {
  const std::lock_guard lock(mutex_);
  return points_.bytes() + places_.capacity() + smoothed_.bytes() + labels_.bytes() +
         boundary_.capacity() * sizeof(OnWalls) + sorted_.capacity() * sizeof(sorted_[0]) +
         (orientation_ ? orientation_->turned.capacity() : 0) + rows_.bytes() + lives_.bytes() +
         deaths_.bytes() + marks_.capacity() * sizeof(Mark) + first_of_.bytes();
}

bool MeshHistory::IsSorted(std::uint64_t revision) const {
  return orientation_.has_value() && revision + 1 == marks_.size();
}

MeshHistory::Snapshot MeshHistory::At(std::uint64_t revision) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[revision];
  const std::uint64_t simplices = mark.simplices - mark.deaths,
                      once = mark.vertices + mark.simplices;
  return {mark.vertices, simplices, IsSorted(revision) ? once + simplices : once, once + simplices};
}

MeshHistory::Cursor MeshHistory::BeginAt(std::uint64_t revision, std::uint64_t position) const {
  const std::lock_guard lock(mutex_);
  const Mark& mark = marks_[revision];
  Cursor cursor{.to = revision, .removed = mark.deaths};  // nothing was there, so nothing goes
  cursor.vertex = std::min<std::size_t>(position, mark.vertices);
  cursor.added = position - cursor.vertex;
  cursor.has_places = revision + 1 == marks_.size();
  // Positions among the simplices say in which order they are read.
  cursor.is_sorted = IsSorted(revision) && (cursor.added == 0 || cursor.added > mark.simplices);
  if (!cursor.is_sorted) return cursor;
  cursor.unsorted = mark.simplices;
  if (cursor.added > 0) cursor.added -= mark.simplices;
  return cursor;
}

DeltaPart MeshHistory::Next(Cursor* cursor, std::size_t max_bytes) const {
  const std::size_t row_bytes = row_size_ * sizeof(std::uint32_t);
  const bool has_smoothed = cursor->has_places && smoothed_.size() > 0;
  const std::size_t point_bytes = d_ * sizeof(double) * (has_smoothed ? 2 : 1);
  const std::size_t max_rows = std::max<std::size_t>(max_bytes / row_bytes, 1);
  DeltaPart part;
  part.revision = cursor->to;
  std::size_t scanned = 0;

  const std::lock_guard lock(mutex_);
  const Mark& end = marks_[cursor->to];
  part.first_vertex = cursor->vertex;
  // Gone: was there at `from`, is not at `to`. Deaths are in order, so those up to `to` suffice.
  part.removed.reserve(std::min({end.deaths - cursor->removed, max_rows, kScanLimit}) * row_size_);
  for (; cursor->removed < end.deaths && scanned < kScanLimit; ++cursor->removed, ++scanned) {
    const std::uint32_t simplex = *deaths_[cursor->removed];
    if (simplex >= marks_[cursor->from].simplices) continue;  // born since
    if (part.removed.size() >= max_rows * row_size_) break;
    const std::uint32_t* const row = rows_[simplex];
    part.removed.insert(part.removed.end(), row, row + row_size_);
  }
  if (cursor->removed < end.deaths) return part;
  // What goes and comes back over several revisions stands in two parts.
  if (cursor->to - cursor->from > 1 && !part.removed.empty()) {
    part.complete = cursor->vertex == end.vertices && cursor->added == end.simplices;
    return part;
  }

  // A part with nothing in it yet takes one of whatever comes next, however large.
  std::size_t left = max_bytes - std::min(max_bytes, part.removed.size() * sizeof(std::uint32_t));
  const auto room_for = [&left](std::size_t bytes, bool empty) {
    return std::max(left / bytes, std::size_t{empty ? 1u : 0u});
  };
  std::size_t points =
      std::min(end.vertices - cursor->vertex, room_for(point_bytes, part.removed.empty()));
  left -= std::min(left, points * point_bytes);
  part.points.reserve(points * d_);
  while (points > 0) {
    const std::size_t run = std::min(points, points_.Run(cursor->vertex));
    const double* const first = points_[cursor->vertex];
    part.points.insert(part.points.end(), first, first + run * d_);
    cursor->vertex += run;
    points -= run;
  }
  if (cursor->has_places) AppendPlaces(cursor->vertex, &part);
  const auto first_on = std::lower_bound(
      boundary_.begin(), boundary_.end(), part.first_vertex,
      [](const OnWalls& one, std::uint64_t vertex) { return one.vertex < vertex; });
  for (auto one = first_on; one != boundary_.end() && one->vertex < cursor->vertex; ++one) {
    part.boundary.push_back(static_cast<std::uint32_t>(one->vertex));
    part.walls.push_back(one->walls);
  }
  if (cursor->vertex < end.vertices) return part;  // a position is among vertices or simplices
  const std::size_t rows = room_for(row_bytes, part.removed.empty() && part.points.empty());
  if (cursor->is_sorted) {
    AppendSorted(cursor, rows, &part);
  } else {
    AppendAdded(cursor, end.simplices, rows, &part);
  }
  part.complete = cursor->added == (cursor->is_sorted ? sorted_.size() : end.simplices);
  return part;
}

// Of the points of the part, which end there.
void MeshHistory::AppendPlaces(std::uint64_t end, DeltaPart* part) const {
  const std::uint64_t first = part->first_vertex;
  if (!places_.empty()) {
    part->places.assign(places_.begin() + static_cast<std::ptrdiff_t>(first),
                        places_.begin() + static_cast<std::ptrdiff_t>(end));
  }
  if (smoothed_.size() == 0) return;
  for (std::uint64_t vertex = first; vertex < end; ++vertex) {
    part->smoothed.insert(part->smoothed.end(), smoothed_[vertex], smoothed_[vertex] + d_);
  }
}

void MeshHistory::AppendRow(std::uint32_t simplex, DeltaPart* part) const {
  const std::uint32_t* const row = rows_[simplex];
  part->added.insert(part->added.end(), row, row + row_size_);
  if (labels_.size() == 0) return;
  part->labels.insert(part->labels.end(), labels_[simplex], labels_[simplex] + label_count_);
}

// Alive at `to`, from the cursor on: `max_rows` at most.
void MeshHistory::AppendAdded(Cursor* cursor, std::size_t end, std::size_t max_rows,
                              DeltaPart* part) const {
  const std::size_t stop = std::min(end, cursor->added + kScanLimit);
  part->added.reserve(std::min(stop - cursor->added, max_rows) * row_size_);
  std::size_t rows = 0;
  for (; cursor->added < stop; ++cursor->added) {
    const std::uint32_t died = DiedAt(cursor->added);
    if (died != 0 && died <= cursor->to) continue;
    if (rows++ == max_rows) return;
    AppendRow(static_cast<std::uint32_t>(cursor->added), part);
  }
}

// The same of the last revision, in lexicographic order.
void MeshHistory::AppendSorted(Cursor* cursor, std::size_t max_rows, DeltaPart* part) const {
  const std::size_t rows = std::min({sorted_.size() - cursor->added, max_rows, kScanLimit});
  core::Orientation& orientation = part->orientation.emplace();
  orientation.orientable = orientation_->orientable;
  if (orientation.orientable) orientation.turned.resize(BytesOfBits(rows));
  part->added.reserve(rows * row_size_);
  for (std::size_t i = 0; i < rows; ++i, ++cursor->added) {
    AppendRow(sorted_[cursor->added], part);
    if (orientation.orientable && IsSet(orientation_->turned, cursor->added))
      Set(&orientation.turned, i);
  }
}

}  // namespace stellate::server
