#include "mesh/spool.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>

namespace stellate::client {
namespace {

using Eigen::Index;

tl::unexpected<Error> CannotUse(const std::string& folder, int why) {
  return Fail(ErrorCode::kFileFailed,
              "cannot write a file without a name in " + folder + ": " + std::strerror(why));
}

// The place of an id among ascending ones.
std::optional<std::size_t> Find(const std::vector<std::uint32_t>& ids, std::uint32_t id) {
  const auto place = std::lower_bound(ids.begin(), ids.end(), id);
  if (place == ids.end() || *place != id) return std::nullopt;
  return static_cast<std::size_t>(place - ids.begin());
}

}  // namespace

Expected<Scratch> Scratch::Begin(const std::string& folder) {
  std::string name = folder + "/.stellate-XXXXXX";
  const int file = mkstemp(name.data());
  if (file < 0) return CannotUse(folder, errno);
  unlink(name.c_str());
  return Scratch(folder, file);
}

Scratch::~Scratch() {
  if (file_ >= 0) close(file_);
}

Expected<void> Scratch::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(end_));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return CannotUse(folder_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(count));
    end_ += static_cast<std::uint64_t>(count);
  }
  return {};
}

Expected<void> Scratch::ReadAt(std::uint64_t place, char* bytes, std::size_t count) const {
  while (count > 0) {
    const ssize_t got = pread(file_, bytes, count, static_cast<off_t>(place));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return CannotUse(folder_, got < 0 ? errno : EIO);
    bytes += got;
    place += static_cast<std::uint64_t>(got);
    count -= static_cast<std::size_t>(got);
  }
  return {};
}

Expected<Spool> Spool::Begin(const std::string& folder, int k, int d,
                             std::vector<std::string> names) {
  Expected<Scratch> points = Scratch::Begin(folder), cells = Scratch::Begin(folder);
  if (!points) return tl::unexpected(points.error());
  if (!cells) return tl::unexpected(cells.error());
  return Spool(std::move(*points), std::move(*cells), k, d, std::move(names));
}

Expected<void> Spool::AddPoints(const Eigen::MatrixXd& points) {
  return points_.Append({reinterpret_cast<const char*>(points.data()),
                         static_cast<std::size_t>(points.size()) * sizeof(double)});
}

bool Spool::AddWalls(std::uint32_t vertex, std::uint64_t bits) {
  if (!walls_.on.empty() && vertex <= walls_.on.back()) return false;
  if (bits == 0) return true;
  walls_.on.push_back(vertex);
  walls_.bits.push_back(bits);
  return true;
}

Expected<void> Spool::AddCells(const SimplexMatrix& turned, std::string_view labels) {
  has_labels_ = has_labels_ || !labels.empty();
  SimplexMatrix rows(turned.rows() + 1, turned.cols());
  rows.topRows(turned.rows()) = turned;
  for (Index j = 0; j < turned.cols(); ++j) {
    const auto label = labels.empty() ? std::uint8_t{0}
                                      : static_cast<std::uint8_t>(labels[static_cast<size_t>(j)]);
    rows(turned.rows(), j) = label;
    ++counts_[label];
    const auto ids = turned.col(j);
    if (std::any_of(ids.begin(), ids.end(),
                    [this](std::uint32_t id) { return Find(walls_.on, id).has_value(); })) {
      near_.insert(near_.end(), rows.col(j).begin(), rows.col(j).end());
    }
  }
  return cells_.Append({reinterpret_cast<const char*>(rows.data()),
                        static_cast<std::size_t>(rows.size()) * sizeof(std::uint32_t)});
}

std::vector<Group> Spool::Groups() const {
  const Eigen::Map<const SimplexMatrix> rows(near_.data(), k_ + 2,
                                             static_cast<Index>(near_.size()) / (k_ + 2));
  // Numbers of their own, in whose order that of the ids stays.
  std::vector<std::uint32_t> used;
  for (Index j = 0; j < rows.cols(); ++j)
    used.insert(used.end(), rows.col(j).begin(), rows.col(j).end() - 1);
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  Mesh near;
  near.points.setZero(d_, static_cast<Index>(used.size()));
  near.simplices.resize(k_ + 1, rows.cols());
  near.orientation =
      Orientation{true, std::vector<std::uint8_t>((static_cast<std::size_t>(rows.cols()) + 7) / 8)};
  near.region_names = names_;
  for (const std::uint32_t id : used) {
    const auto place = Find(walls_.on, id);
    if (!walls_.on.empty()) near.walls.push_back(place ? walls_.bits[*place] : 0);
  }
  for (Index j = 0; j < rows.cols(); ++j) {
    auto column = near.simplices.col(j);
    for (Index i = 0; i <= k_; ++i) column[i] = static_cast<std::uint32_t>(*Find(used, rows(i, j)));
    if (column[k_ - 1] > column[k_]) {
      std::swap(column[k_ - 1], column[k_]);
      const auto s = static_cast<std::size_t>(j);
      near.orientation->turned[s / 8] |= static_cast<std::uint8_t>(1u << (s % 8));
    }
    if (has_labels_) near.labels.push_back(static_cast<std::uint8_t>(rows(k_ + 1, j)));
  }
  std::vector<std::uint8_t> known;
  for (std::size_t label = 0; has_labels_ && label < counts_.size(); ++label)
    if (counts_[label] > 0) known.push_back(static_cast<std::uint8_t>(label));
  std::vector<Group> groups = GroupsOf(near, known);
  for (Group& group : groups)
    for (std::uint32_t& id : group.simplices.reshaped()) id = used[id];
  return groups;
}

Expected<void> Spool::EachPoints(
    const std::function<Expected<void>(const Eigen::MatrixXd&)>& take) const {
  const std::uint64_t row = sizeof(double) * static_cast<std::uint64_t>(d_);
  for (std::uint64_t place = 0; place < points_.size(); place += kBlockRows * row) {
    const std::uint64_t bytes = std::min(kBlockRows * row, points_.size() - place);
    Eigen::MatrixXd block(d_, static_cast<Index>(bytes / row));
    if (auto ok = points_.ReadAt(place, reinterpret_cast<char*>(block.data()), bytes); !ok)
      return ok;
    if (auto ok = take(block); !ok) return ok;
  }
  return {};
}

Expected<void> Spool::EachCells(
    int label, const std::function<Expected<void>(const SimplexMatrix&)>& take) const {
  const std::uint64_t row = sizeof(std::uint32_t) * static_cast<std::uint64_t>(k_ + 2);
  for (std::uint64_t place = 0; place < cells_.size(); place += kBlockRows * row) {
    const std::uint64_t bytes = std::min(kBlockRows * row, cells_.size() - place);
    SimplexMatrix block(k_ + 2, static_cast<Index>(bytes / row));
    if (auto ok = cells_.ReadAt(place, reinterpret_cast<char*>(block.data()), bytes); !ok)
      return ok;
    std::vector<Index> columns;
    for (Index j = 0; j < block.cols(); ++j)
      if (block(k_ + 1, j) == static_cast<std::uint32_t>(label)) columns.push_back(j);
    const SimplexMatrix some = block.topRows(k_ + 1)(Eigen::all, columns);
    if (auto ok = take(some); !ok) return ok;
  }
  return {};
}

}  // namespace stellate::client
