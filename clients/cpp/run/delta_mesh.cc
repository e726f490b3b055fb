#include "run/delta_mesh.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <utility>

#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {
namespace {

// A list for each vertex that is the lowest of any simplex, no longer than a star is large.
template <size_t N>
class FixedSet final : public SimplexSet {
 public:
  explicit FixedSet(size_t labels) : labels_each_(labels) {}

  std::size_t bytes() const override {
    return nodes_.capacity() * sizeof(Node) + first_of_.capacity() * sizeof(first_of_[0]) +
           labels_.capacity();
  }

  bool Add(const char* ids, Eigen::Index count, std::uint64_t vertices,
           const Marks& marks) override {
    for (Eigen::Index i = 0; i < count; ++i) {
      const Simplex simplex = Read(ids, i);
      if (*std::max_element(simplex.begin(), simplex.end()) >= vertices) return false;
      if (simplex[0] >= first_of_.size()) first_of_.resize(vertices, kNone);
      std::uint32_t place = free_;
      if (place == kNone) {
        place = static_cast<std::uint32_t>(nodes_.size());
        nodes_.emplace_back();
      } else {
        free_ = nodes_[place].next;
      }
      nodes_[place] = {simplex, first_of_[simplex[0]]};
      if (marks.turned != nullptr) {
        turned_.resize(nodes_.size());
        turned_[place] = (marks.turned[i / 8] >> (i % 8) & 1) != 0;
      }
      if (marks.labels != nullptr) {
        labels_.resize(nodes_.size() * labels_each_);
        const auto each = static_cast<std::ptrdiff_t>(labels_each_);
        std::copy_n(marks.labels + i * each, each, labels_.begin() + place * each);
      }
      first_of_[simplex[0]] = place;
      ++size_;
    }
    return true;
  }

  bool Remove(const char* ids, Eigen::Index count) override {
    for (Eigen::Index i = 0; i < count; ++i) {
      const Simplex simplex = Read(ids, i);
      if (simplex[0] >= first_of_.size()) return false;
      std::uint32_t* link = &first_of_[simplex[0]];
      while (*link != kNone && !AreEqual(nodes_[*link].simplex, simplex))
        link = &nodes_[*link].next;
      if (*link == kNone) return false;
      const std::uint32_t place = *link;
      *link = std::exchange(nodes_[place].next, free_);
      free_ = place;
      --size_;
    }
    return true;
  }

  std::optional<Simplices> Sorted() const override {
    Simplices sorted{SimplexMatrix(N, static_cast<Eigen::Index>(size_)), {}, {}};
    if (!turned_.empty()) sorted.turned.assign((size_ + 7) / 8, 0);
    if (!labels_.empty()) sorted.labels.assign(size_ * labels_each_, 0);
    size_t column = 0;
    std::vector<std::pair<Simplex, std::uint32_t>> star;  // and their nodes
    for (const std::uint32_t first : first_of_) {
      star.clear();
      for (std::uint32_t s = first; s != kNone; s = nodes_[s].next) {
        star.emplace_back(nodes_[s].simplex, s);
      }
      std::sort(star.begin(), star.end());
      for (size_t i = 0; i < star.size(); ++i) {
        const auto& [simplex, node] = star[i];
        if (i > 0 && AreEqual(simplex, star[i - 1].first)) return std::nullopt;
        std::copy(simplex.begin(), simplex.end(),
                  sorted.columns.col(static_cast<Eigen::Index>(column)).begin());
        if (node < turned_.size() && turned_[node]) {
          sorted.turned[column / 8] |= static_cast<std::uint8_t>(1 << column % 8);
        }
        if (node * labels_each_ < labels_.size()) {
          const auto each = static_cast<std::ptrdiff_t>(labels_each_);
          std::copy_n(labels_.begin() + node * each, each,
                      sorted.labels.begin() + static_cast<std::ptrdiff_t>(column) * each);
        }
        ++column;
      }
    }
    return sorted;
  }

 private:
  using Simplex = std::array<std::uint32_t, N>;
  struct Node {
    Simplex simplex;
    std::uint32_t next;
  };
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  // Without the call that operator== makes for a few bytes.
  static bool AreEqual(const Simplex& a, const Simplex& b) {
    bool equal = true;
    for (size_t i = 0; i < N; ++i) equal = equal && a[i] == b[i];
    return equal;
  }

  static Simplex Read(const char* ids, Eigen::Index i) {
    Simplex simplex;
    std::memcpy(simplex.data(), ids + static_cast<size_t>(i) * sizeof(Simplex), sizeof(Simplex));
    return simplex;
  }

  std::vector<std::uint32_t> first_of_;  // by vertex
  std::vector<Node> nodes_;
  std::vector<bool> turned_;          // by node, as far as any was
  std::vector<std::uint8_t> labels_;  // by node, so many each, as far as any has one
  size_t labels_each_;
  std::uint32_t free_ = kNone;  // a list of its own
  size_t size_ = 0;
};

}  // namespace

std::unique_ptr<SimplexSet> MakeSimplexSet(int k, std::size_t labels) {
  switch (k) {
    case 1:
      return std::make_unique<FixedSet<2>>(labels);
    case 2:
      return std::make_unique<FixedSet<3>>(labels);
    case 3:
      return std::make_unique<FixedSet<4>>(labels);
    case 4:
      return std::make_unique<FixedSet<5>>(labels);
    case 5:
      return std::make_unique<FixedSet<6>>(labels);
    case 6:
      return std::make_unique<FixedSet<7>>(labels);
    case kMaxSimplexDimension:
      return std::make_unique<FixedSet<8>>(labels);
    default:
      return nullptr;
  }
}

Expected<DeltaMesh> DeltaMesh::Create(int k, int d, bool boundary_only, std::size_t most_bytes) {
  const std::size_t labels = boundary_only ? 2 : 1;
  std::unique_ptr<SimplexSet> set = MakeSimplexSet(k, labels);
  if (set == nullptr) {
    return Fail(ErrorCode::kRefused,
                "dimension is " + std::to_string(k) + " but this client holds meshes of 1 to " +
                    std::to_string(kMaxSimplexDimension),
                k < 1 ? "INVALID_ARGUMENT" : "LIMIT_EXCEEDED");
  }
  return DeltaMesh(k, d, labels, std::move(set), most_bytes);
}

std::size_t DeltaMesh::HalfOfTheMemory() {
  return static_cast<std::size_t>(sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) / 2;
}

Expected<void> DeltaMesh::CheckRoom(std::size_t more) const {
  const std::size_t held = coordinates_.capacity() * sizeof(coordinates_[0]) +
                           boundary_.capacity() * sizeof(boundary_[0]) + simplex_set_->bytes() +
                           pending_bytes_ + more;
  if (held <= most_bytes_) return {};
  return Fail(ErrorCode::kServerFailed,
              "the mesh that the server sends takes more than " +
                  std::to_string(most_bytes_ >> 20) +
                  " MB, half of this machine's memory: fetch it on a larger one",
              "LIMIT_EXCEEDED");
}

void DeltaMesh::Reset() {
  revision_ = 0;
  ForgetPending();
  coordinates_.clear();
  boundary_.clear();
  orientation_.reset();
  simplex_set_ = MakeSimplexSet(k_, labels_per_simplex_);
}

Expected<void> DeltaMesh::Absorb(v1::DeltaChunk&& chunk) {
  const std::uint64_t revision = chunk.delta().revision();
  if (revision <= revision_ || (!pending_.empty() && pending_.back().revision() != revision)) {
    return tl::unexpected(BrokenProtocol("revision " + std::to_string(revision) + " out of order"));
  }
  const std::size_t bytes = chunk.ByteSizeLong();
  if (Expected<void> ok = CheckRoom(bytes); !ok) return ok;
  pending_bytes_ += bytes;
  orientation_.reset();
  pending_.push_back(std::move(*chunk.mutable_delta()));
  if (!chunk.complete()) return {};
  pending_bytes_ = 0;
  for (const v1::MeshDelta& delta : std::exchange(pending_, {})) {
    if (Expected<void> ok = Apply(delta); !ok) return ok;
  }
  revision_ = revision;
  return {};
}

Expected<void> DeltaMesh::Add(v1::DownloadMeshResponse&& part) {
  if (Expected<void> ok = CheckRoom(part.ByteSizeLong()); !ok) return ok;
  v1::MeshDelta delta;
  delta.set_first_vertex(part.first_vertex());
  delta.mutable_points()->Swap(part.mutable_points());
  delta.mutable_added()->Swap(part.mutable_cells());
  delta.mutable_boundary_vertices()->Swap(part.mutable_boundary_vertices());
  delta.mutable_boundary_walls()->Swap(part.mutable_boundary_walls());
  delta.mutable_added_labels()->swap(*part.mutable_cell_labels());
  const std::uint64_t cells = delta.added().shape_size() > 0 ? delta.added().shape(0) : 0;
  const v1::Orientation& orientation = part.orientation();
  const bool has_bits = orientation.orientable();
  if (has_bits && orientation.turned().size() != (cells + 7) / 8)
    return tl::unexpected(BrokenProtocol("an orientation that does not fit its simplices"));
  if (parts_simplices_ == 0 && part.has_orientation()) orientation_ = {has_bits, {}};
  if (cells > 0 && !part.has_orientation()) orientation_.reset();
  parts_simplices_ += cells;
  return Apply(delta, has_bits ? orientation.turned().data() : nullptr);
}

Expected<void> DeltaMesh::Orient(const v1::Orientation& chunk) {
  if (chunk.first_simplex() == 0) orientation_ = {chunk.orientable(), {}};
  if (!orientation_ || chunk.first_simplex() != 8 * orientation_->turned.size())
    return tl::unexpected(BrokenProtocol("an orientation that is out of order"));
  if (Expected<void> ok = CheckRoom(orientation_->turned.size() + chunk.turned().size()); !ok)
    return ok;
  orientation_->turned.insert(orientation_->turned.end(), chunk.turned().begin(),
                              chunk.turned().end());
  return {};
}

// Removes first: a simplex that goes and comes back stands in both.
Expected<void> DeltaMesh::Apply(const v1::MeshDelta& delta, const char* turned) {
  const size_t known = coordinates_.size();
  if (Expected<void> ok =
          AppendNumbers(delta.points(), {static_cast<std::uint32_t>(d_)}, &coordinates_);
      !ok) {
    return ok;
  }
  if (coordinates_.size() > known &&
      delta.first_vertex() * static_cast<std::uint64_t>(d_) != known) {
    return tl::unexpected(BrokenProtocol("vertices from " + std::to_string(delta.first_vertex()) +
                                         " on, out of order"));
  }
  if (Expected<void> ok = NoteWalls(delta); !ok) return ok;
  const std::uint32_t width = static_cast<std::uint32_t>(k_) + 1;
  const Expected<Eigen::Index> removed = CountRows(delta.removed(), width);
  if (!removed) return tl::unexpected(removed.error());
  const Expected<Eigen::Index> added = CountRows(delta.added(), width);
  if (!added) return tl::unexpected(added.error());
  const std::string& labels = delta.added_labels();
  const std::size_t most = labels_per_simplex_ * static_cast<size_t>(*added);
  const bool may_lack = labels_per_simplex_ == 1;  // without an arrangement there are none
  if (labels.size() != most && !(may_lack && labels.empty())) {
    return tl::unexpected(BrokenProtocol("labels that do not fit their simplices"));
  }
  if (!simplex_set_->Remove(delta.removed().data().data(), *removed)) {
    return tl::unexpected(BrokenProtocol("the removal of a simplex that is not there"));
  }
  const SimplexSet::Marks marks{turned, labels.empty() ? nullptr : labels.data()};
  if (!simplex_set_->Add(delta.added().data().data(), *added, vertices(), marks)) {
    return tl::unexpected(BrokenProtocol("a simplex with a vertex that it never sent"));
  }
  return {};
}

Expected<void> DeltaMesh::NoteWalls(const v1::MeshDelta& delta) {
  bool fits = delta.boundary_vertices_size() == delta.boundary_walls_size();
  for (int i = 0; fits && i < delta.boundary_vertices_size(); ++i) {
    fits = delta.boundary_vertices(i) < vertices();
    boundary_.emplace_back(delta.boundary_vertices(i), delta.boundary_walls(i));
  }
  if (!fits) return tl::unexpected(BrokenProtocol("walls of vertices that it never sent"));
  return {};
}

Expected<Mesh> DeltaMesh::Take() const {
  std::optional<SimplexSet::Simplices> simplices = simplex_set_->Sorted();
  if (!simplices) return tl::unexpected(BrokenProtocol("a simplex that was there already"));
  Mesh mesh;
  mesh.points = Eigen::Map<const Eigen::MatrixXd>(
      coordinates_.data(), d_, static_cast<Eigen::Index>(coordinates_.size()) / d_);
  mesh.simplices = std::move(simplices->columns);
  std::vector<std::uint8_t>& labels = simplices->labels;
  if (labels_per_simplex_ == 1) {
    mesh.labels = std::move(labels);
  } else {
    for (size_t i = 0; i < labels.size(); i += 2) mesh.sides.push_back({labels[i], labels[i + 1]});
  }
  mesh.orientation = orientation_;
  if (orientation_ && parts_simplices_ > 0) mesh.orientation->turned = std::move(simplices->turned);
  const auto count = static_cast<size_t>(mesh.simplices.cols());
  if (orientation_ && orientation_->orientable &&
      mesh.orientation->turned.size() != (count + 7) / 8)
    return tl::unexpected(BrokenProtocol("an orientation that does not fit its simplices"));
  if (!boundary_.empty()) mesh.walls.assign(vertices(), 0);
  for (const auto& [vertex, walls] : boundary_) mesh.walls[vertex] = walls;
  return mesh;
}

}  // namespace stellate::client
