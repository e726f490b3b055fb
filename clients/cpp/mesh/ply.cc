#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <utility>

#include "mesh/formats.h"

namespace stellate::client {
namespace {

class PlyWriter final : public MeshWriter {
 public:
  PlyWriter(Draft draft, const FileShape& shape)
      : draft_(std::move(draft)), is_curve_(shape.groups[0].dimension == 1) {
    head_ = "ply\nformat binary_little_endian 1.0\nelement vertex " +
            std::to_string(shape.vertices) +
            "\nproperty double x\nproperty double y\nproperty double z\nelement " +
            (is_curve_ ? "edge " : "face ") + std::to_string(shape.simplices()) +
            (is_curve_ ? "\nproperty int vertex1\nproperty int vertex2"
                       : "\nproperty list uchar int vertex_indices") +
            "\nend_header\n";
  }

  Expected<void> AddPoints(const Eigen::Ref<const Eigen::MatrixXd>& points) override {
    if (auto ok = BeginOnce(); !ok) return ok;
    const Eigen::MatrixXd space = InSpace(points);
    return draft_.Write({reinterpret_cast<const char*>(space.data()),
                         static_cast<std::size_t>(space.size()) * sizeof(double)});
  }

  Expected<void> AddCells(std::size_t /*group*/,
                          const Eigen::Ref<const SimplexMatrix>& cells) override {
    if (auto ok = BeginOnce(); !ok) return ok;
    std::string bytes;
    const std::size_t ids = sizeof(std::uint32_t) * static_cast<std::size_t>(cells.rows());
    bytes.reserve(static_cast<std::size_t>(cells.cols()) * (ids + 1));
    for (Eigen::Index j = 0; j < cells.cols(); ++j) {
      if (!is_curve_) bytes += '\3';
      bytes.append(reinterpret_cast<const char*>(cells.col(j).data()), ids);
    }
    return draft_.Write(bytes);
  }

  Expected<void> Finish() override {
    if (auto ok = BeginOnce(); !ok) return ok;
    return draft_.Finish();
  }

 private:
  Expected<void> BeginOnce() {
    return head_.empty() ? Expected<void>() : draft_.Write(std::exchange(head_, {}));
  }

  Draft draft_;
  bool is_curve_;
  std::string head_;  // not yet written
};

}  // namespace

std::unique_ptr<MeshWriter> MakePlyWriter(Draft draft, const FileShape& shape) {
  return std::make_unique<PlyWriter>(std::move(draft), shape);
}

}  // namespace stellate::client
