#include "mesh_builder.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <utility>

#include "convert.h"

namespace stellate::client {
namespace {

template <size_t N>
class FixedLog final : public SimplexLog {
 public:
  void Append(const std::vector<std::uint32_t>& ids, bool removed) override {
    std::vector<Simplex>& log = removed ? removed_ : added_;
    for (size_t i = 0; i + N <= ids.size(); i += N) {
      Simplex& simplex = log.emplace_back();
      std::copy_n(ids.begin() + static_cast<std::ptrdiff_t>(i), N, simplex.begin());
    }
    if (removed_.size() > kSlack + added_.size() / 2) Compact();
  }

  SimplexMatrix Take() override {
    Compact();
    SimplexMatrix simplices(N, static_cast<Eigen::Index>(added_.size()));
    for (size_t j = 0; j < added_.size(); ++j) {
      std::copy(added_[j].begin(), added_[j].end(),
                simplices.col(static_cast<Eigen::Index>(j)).begin());
    }
    return simplices;
  }

 private:
  using Simplex = std::array<std::uint32_t, N>;
  static constexpr size_t kSlack = 10'000;

  // As multisets, since a simplex may come, go and come back between two calls.
  void Compact() {
    std::sort(added_.begin(), added_.end());
    std::sort(removed_.begin(), removed_.end());
    std::vector<Simplex> left;
    std::set_difference(added_.begin(), added_.end(), removed_.begin(), removed_.end(),
                        std::back_inserter(left));
    added_ = std::move(left);
    removed_.clear();
  }

  std::vector<Simplex> added_, removed_;
};

Error Inconsistent(const std::string& what) {
  return {ErrorCode::kServerFailed, "", "the server sent " + what};
}

}  // namespace

std::unique_ptr<SimplexLog> MakeSimplexLog(int k) {
  switch (k) {
    case 1:
      return std::make_unique<FixedLog<2>>();
    case 2:
      return std::make_unique<FixedLog<3>>();
    case 3:
      return std::make_unique<FixedLog<4>>();
    case 4:
      return std::make_unique<FixedLog<5>>();
    case 5:
      return std::make_unique<FixedLog<6>>();
    case 6:
      return std::make_unique<FixedLog<7>>();
    case kMaxSimplexDimension:
      return std::make_unique<FixedLog<8>>();
    default:
      return nullptr;
  }
}

Expected<MeshBuilder> MeshBuilder::Create(int k, int d) {
  std::unique_ptr<SimplexLog> log = MakeSimplexLog(k);
  if (log == nullptr) {
    return Fail(ErrorCode::kRefused,
                "dimension is " + std::to_string(k) + " but this client holds meshes of 1 to " +
                    std::to_string(kMaxSimplexDimension),
                "LIMIT_EXCEEDED");
  }
  return MeshBuilder(k, d, std::move(log));
}

void MeshBuilder::Reset() {
  revision_ = 0;
  pending_.clear();
  coordinates_.clear();
  log_ = MakeSimplexLog(k_);
}

Expected<void> MeshBuilder::Absorb(v1::DeltaChunk&& chunk) {
  const std::uint64_t revision = chunk.delta().revision();
  if (revision <= revision_ || (!pending_.empty() && pending_.back().revision() != revision)) {
    return tl::unexpected(Inconsistent("revision " + std::to_string(revision) + " out of order"));
  }
  pending_.push_back(std::move(*chunk.mutable_delta()));
  if (!chunk.complete()) return {};
  for (const v1::MeshDelta& delta : std::exchange(pending_, {})) {
    if (const Expected<void> ok = Apply(delta); !ok) return ok;
  }
  revision_ = revision;
  return {};
}

Expected<void> MeshBuilder::Add(v1::DownloadMeshResponse&& part) {
  v1::MeshDelta delta;
  delta.set_first_vertex(part.first_vertex());
  delta.mutable_points()->Swap(part.mutable_points());
  delta.mutable_added()->Swap(part.mutable_cells());
  if (delta.added().shape_size() > 0) parts_simplices_ += delta.added().shape(0);
  return Apply(delta);
}

Expected<void> MeshBuilder::Apply(const v1::MeshDelta& delta) {
  const Expected<Eigen::MatrixXd> points =
      FromArray(delta.points(), {static_cast<std::uint32_t>(d_)});
  if (!points) return tl::unexpected(points.error());
  if (points->cols() > 0) {
    if (delta.first_vertex() * static_cast<std::uint64_t>(d_) != coordinates_.size()) {
      return tl::unexpected(Inconsistent("vertices from " + std::to_string(delta.first_vertex()) +
                                         " on, out of order"));
    }
    coordinates_.insert(coordinates_.end(), points->data(), points->data() + points->size());
  }
  std::vector<std::uint32_t> added, removed;
  const std::uint32_t width = static_cast<std::uint32_t>(k_) + 1;
  for (const auto& [array, ids] :
       {std::pair(&delta.added(), &added), std::pair(&delta.removed(), &removed)}) {
    if (const Expected<void> ok = AppendIds(*array, width, ids); !ok) {
      return tl::unexpected(ok.error());
    }
  }
  log_->Append(added, false);
  log_->Append(removed, true);
  return {};
}

Expected<Mesh> MeshBuilder::Take() {
  Mesh mesh;
  mesh.points = Eigen::Map<const Eigen::MatrixXd>(
      coordinates_.data(), d_, static_cast<Eigen::Index>(coordinates_.size()) / d_);
  mesh.simplices = log_->Take();
  if (mesh.simplices.size() > 0 &&
      static_cast<Eigen::Index>(mesh.simplices.maxCoeff()) >= mesh.points.cols()) {
    return tl::unexpected(Inconsistent("a simplex with vertex " +
                                       std::to_string(mesh.simplices.maxCoeff()) +
                                       ", which it never sent"));
  }
  return mesh;
}

}  // namespace stellate::client
