#include "run/part_files.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {

PartFiles::PartFiles(std::vector<std::string> paths, int k, int d, Report report)
    : paths_(std::move(paths)) {
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
  if (files_.empty()) return tl::unexpected(failures_.front());
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
  if (files_.empty()) return tl::unexpected(failures_.front());
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
  vertices_ += static_cast<std::uint64_t>(points->cols());
  return ToAll([&points](StreamedFile& file) { return file.writer->AddPoints(*points); });
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
  const auto written = ToAll([this](StreamedFile& file) {
    return file.writer->AddCells(0, file.is_turned ? turned_ : ascending_);
  });
  if (!written) return tl::unexpected(written.error());
  return Taken::kYes;
}

std::vector<Error> PartFiles::Finish() {
  for (StreamedFile& file : files_) {
    if (const Expected<void> ok = file.writer->Finish(); !ok) failures_.push_back(ok.error());
  }
  files_.clear();
  return std::move(failures_);
}

}  // namespace stellate::client
