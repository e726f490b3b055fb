#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mesh/formats.h"
#include "mesh/groups.h"
#include "stellate/error.h"

namespace stellate::client {

// A file without a name, which is gone when it is closed. Errors are kFileFailed.
class Scratch {
 public:
  // In that folder.
  static Expected<Scratch> Begin(const std::string& folder);
  ~Scratch();
  Scratch(Scratch&& other) noexcept
      : folder_(std::move(other.folder_)),
        file_(std::exchange(other.file_, -1)),
        end_(other.end_) {}
  Scratch& operator=(Scratch&&) = delete;

  Expected<void> Append(std::string_view bytes);
  Expected<void> ReadAt(std::uint64_t place, char* bytes, std::size_t count) const;
  std::uint64_t size() const { return end_; }

 private:
  Scratch(std::string folder, int file) : folder_(std::move(folder)), file_(file) {}

  std::string folder_;
  int file_ = -1;
  std::uint64_t end_ = 0;
};

// A mesh with boundary on its way into files, where it is until it is known what groups it has.
// Points and cells are in files without names; in memory are only the cells that have a vertex on a
// wall, which alone say what faces there are.
class Spool {
 public:
  // `names`: of the regions.
  static Expected<Spool> Begin(const std::string& folder, int k, int d,
                               std::vector<std::string> names);

  Expected<void> AddPoints(const Eigen::MatrixXd& points);
  // Of a vertex beyond those before; else false.
  bool AddWalls(std::uint32_t vertex, std::uint64_t bits);
  // (k+1) x m, turned to agree, after all points. `labels`: of each; empty: none has one.
  Expected<void> AddCells(const SimplexMatrix& turned, std::string_view labels);

  // Those of the mesh; those of the regions have only the cells that are in memory.
  std::vector<Group> Groups() const;
  const PointWalls& walls() const { return walls_; }
  bool has_labels() const { return has_labels_; }
  // How many cells have a label; 0: all, where there are no labels.
  std::uint64_t CountOf(int label) const { return counts_[static_cast<std::size_t>(label)]; }

  // All of them, some at a time.
  Expected<void> EachPoints(
      const std::function<Expected<void>(const Eigen::MatrixXd&)>& take) const;
  // All that have that label.
  Expected<void> EachCells(int label,
                           const std::function<Expected<void>(const SimplexMatrix&)>& take) const;

 private:
  Spool(Scratch points, Scratch cells, int k, int d, std::vector<std::string> names)
      : points_(std::move(points)),
        cells_(std::move(cells)),
        k_(k),
        d_(d),
        names_(std::move(names)) {}

  Scratch points_, cells_;  // cells with their label after their ids
  int k_, d_;
  std::vector<std::string> names_;
  PointWalls walls_;
  std::vector<std::uint32_t> near_;  // as in the file, those that are near a wall
  std::array<std::uint64_t, 256> counts_ = {};
  bool has_labels_ = false;
};

}  // namespace stellate::client
