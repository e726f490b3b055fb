#include "run/part_files.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <utility>

#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {

PartFiles::PartFiles(std::vector<std::string> paths, const v1::Mesh& mesh, Report report)
    : region_names_(mesh.spec().region_names().begin(), mesh.spec().region_names().end()) {
  const int k = SimplexDimension(mesh.spec());
  const int d = static_cast<int>(mesh.spec().ambient_dimension());
  for (std::string& path : paths) {
    const bool is_grouped = NeedsGroups(path, k, d, mesh.spec().walls() > 0);
    (is_grouped ? grouped_ : paths_).push_back(std::move(path));
  }
  shape_.dimension = k;
  shape_.ambient_dimension = d;
  shape_.report = std::move(report);
}

Expected<void> PartFiles::Begin(const v1::DownloadMeshResponse& part) {
  is_begun_ = true;
  shape_.vertices = part.vertices();
  shape_.groups = {{shape_.dimension, part.simplices()}};
  for (const std::string& path : paths_) {
    Expected<StreamedFile> file = StreamedFile::Begin(path, shape_);
    if (file) {
      files_.push_back(std::move(*file));
    } else {
      failures_.push_back(file.error());
    }
  }
  if (!grouped_.empty()) {
    const std::filesystem::path folder = std::filesystem::path(grouped_[0]).parent_path();
    Expected<Spool> spool = Spool::Begin(folder.empty() ? "." : folder.string(), shape_.dimension,
                                         shape_.ambient_dimension, region_names_);
    if (spool) {
      spool_.emplace(std::move(*spool));
    } else if (auto ok = GiveUpSpool(spool.error()); !ok) {
      return ok;
    }
  }
  if (files_.empty() && !spool_) return tl::unexpected(failures_.front());
  return {};
}

// A file that cannot be written is given up, and the others go on.
template <typename Write>
Expected<void> PartFiles::ToAll(const Write& write) {
  std::erase_if(files_, [&](StreamedFile& file) {
    const Expected<void> written = write(file);
    if (!written) failures_.push_back(written.error());
    return !written;
  });
  if (files_.empty() && !spool_) return tl::unexpected(failures_.front());
  return {};
}

Expected<void> PartFiles::TakePoints(const v1::DownloadMeshResponse& part) {
  const Expected<Eigen::MatrixXd> points =
      FromArray(part.points(), {static_cast<std::uint32_t>(shape_.ambient_dimension)});
  if (!points) return tl::unexpected(points.error());
  if (points->cols() == 0) return {};
  if (part.first_vertex() != vertices_ || simplices_ > 0) {
    return tl::unexpected(BrokenProtocol("vertices from " + std::to_string(part.first_vertex()) +
                                         " on, out of order"));
  }
  const std::uint64_t before = vertices_;
  vertices_ += static_cast<std::uint64_t>(points->cols());
  if (spool_) {
    if (auto ok = TakeWalls(part, before); !ok) return ok;
    if (const auto added = spool_->AddPoints(*points); !added) {
      if (auto ok = GiveUpSpool(added.error()); !ok) return ok;
    }
  }
  return ToAll([&points](StreamedFile& file) { return file.writer->AddPoints(*points); });
}

Expected<void> PartFiles::TakeWalls(const v1::DownloadMeshResponse& part, std::uint64_t before) {
  bool fits = part.boundary_vertices_size() == part.boundary_walls_size();
  for (int i = 0; fits && i < part.boundary_vertices_size(); ++i) {
    const std::uint32_t vertex = part.boundary_vertices(i);
    fits =
        vertex >= before && vertex < vertices_ && spool_->AddWalls(vertex, part.boundary_walls(i));
  }
  if (!fits) return tl::unexpected(BrokenProtocol("walls of vertices that are not beside them"));
  return {};
}

Expected<void> PartFiles::SpoolCells(const v1::DownloadMeshResponse& part) {
  const std::string& labels = part.cell_labels();
  const auto count = static_cast<std::size_t>(turned_.cols());
  const bool is_first = simplices_ == count;
  if ((!labels.empty() && labels.size() != count) ||
      (!is_first && labels.empty() == spool_->has_labels())) {
    return tl::unexpected(BrokenProtocol("labels that do not fit their simplices"));
  }
  const auto added = spool_->AddCells(turned_, labels);
  return added ? added : GiveUpSpool(added.error());
}

// Of what it was for no file can be written; the others go on.
Expected<void> PartFiles::GiveUpSpool(const Error& why) {
  for (const std::string& path : grouped_)
    failures_.push_back({why.code, why.reason, path + ": " + why.message});
  grouped_.clear();
  spool_.reset();
  if (files_.empty()) return tl::unexpected(failures_.front());
  return {};
}

Expected<bool> PartFiles::ReadCells(const v1::DownloadMeshResponse& part) {
  const auto width = static_cast<std::uint32_t>(shape_.dimension) + 1;
  const Expected<Eigen::Index> count = CountRows(part.cells(), width);
  if (!count) return tl::unexpected(count.error());
  ascending_.resize(width, *count);
  if (*count == 0) return true;
  if (!part.has_orientation()) return false;
  std::memcpy(ascending_.data(), part.cells().data().data(), part.cells().data().size());
  for (Eigen::Index j = 0; j < *count; ++j) {
    const auto row = ascending_.col(j);
    for (Eigen::Index i = 1; i < row.size(); ++i) {
      if (row[i - 1] >= row[i]) return tl::unexpected(BrokenProtocol("ids that do not ascend"));
    }
    if (row[row.size() - 1] >= vertices_)
      return tl::unexpected(BrokenProtocol("a simplex with a vertex that it never sent"));
    if (!std::lexicographical_compare(last_.begin(), last_.end(), row.begin(), row.end()))
      return false;
    last_.assign(row.begin(), row.end());
  }
  turned_ = ascending_;
  const v1::Orientation& orientation = part.orientation();
  if (!orientation.orientable()) return true;
  const std::string& bits = orientation.turned();
  if (bits.size() != (static_cast<std::size_t>(*count) + 7) / 8)
    return tl::unexpected(BrokenProtocol("an orientation that does not fit its simplices"));
  for (Eigen::Index j = 0; j < *count; ++j) {
    if ((static_cast<unsigned char>(bits[static_cast<std::size_t>(j) / 8]) >> (j % 8) & 1) != 0)
      std::swap(turned_(width - 2, j), turned_(width - 1, j));
  }
  return true;
}

Expected<PartFiles::Taken> PartFiles::Take(const v1::DownloadMeshResponse& part) {
  if (!is_begun_) {
    if (auto ok = Begin(part); !ok) return tl::unexpected(ok.error());
  }
  if (part.vertices() != shape_.vertices || part.simplices() != shape_.simplices()) {
    return tl::unexpected(BrokenProtocol("another size of the mesh than it had announced"));
  }
  if (auto ok = TakePoints(part); !ok) return tl::unexpected(ok.error());
  const Expected<bool> in_order = ReadCells(part);
  if (!in_order) return tl::unexpected(in_order.error());
  if (!*in_order) return Taken::kNotSo;
  simplices_ += static_cast<std::uint64_t>(ascending_.cols());
  if (vertices_ > shape_.vertices || simplices_ > shape_.simplices())
    return tl::unexpected(BrokenProtocol("more of the mesh than it had announced"));
  if (ascending_.cols() == 0) return Taken::kYes;
  if (spool_) {
    if (auto ok = SpoolCells(part); !ok) return tl::unexpected(ok.error());
  }
  const auto written = ToAll([this](StreamedFile& file) {
    return file.writer->AddCells(0, file.is_turned ? turned_ : ascending_);
  });
  if (!written) return tl::unexpected(written.error());
  return Taken::kYes;
}

Expected<bool> PartFiles::WriteGroups() {
  for (const std::string& path : grouped_) {
    shape_.groups.clear();
    const Expected<bool> saved = SaveSpooled(path, *spool_, shape_);
    if (!saved) {
      failures_.push_back(saved.error());
    } else if (!*saved) {
      return false;
    }
  }
  return true;
}

std::vector<Error> PartFiles::Finish() {
  for (StreamedFile& file : files_) {
    if (const Expected<void> ok = file.writer->Finish(); !ok) failures_.push_back(ok.error());
  }
  files_.clear();
  return std::move(failures_);
}

}  // namespace stellate::client
