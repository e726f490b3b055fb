#include "core/certificate/complex/links.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "core/base/first_ids.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/certificate/complex/fundamental_group.h"
#include "core/certificate/complex/small_index.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

using SimplexIds = std::vector<std::uint32_t>;

constexpr const char* kNotClosed = "is not closed";
constexpr const char* kSeveralParts = "falls into several parts";

// A face and the simplices that have it: its link, in place.
struct Face {
  std::array<std::uint32_t, kMaxDimension> ids{};
  int size = 0;

  bool Has(std::uint32_t v) const {
    return std::find(ids.begin(), ids.begin() + size, v) != ids.begin() + size;
  }
  Face With(std::uint32_t v) const {
    Face f = *this;
    f.ids[f.size++] = v;
    return f;
  }
};

// The result for a part of the vertices.
struct LinksOfPart {
  LinkReport report;
  std::vector<std::uint32_t> blamed;  // vertices, with repetitions
  std::int64_t used_vertices = 0;
  // Sums over the vertices.
  std::int64_t link_vertices = 0, link_edges = 0, link_triangles = 0;
};

class LinkChecker {
 public:
  LinkChecker(const Adjacency& adjacency, std::uint32_t ignored)
      : adjacency_(adjacency), list_(adjacency.list()), k_(list_.k), ignored_(ignored) {}

  LinksOfPart Run(std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t v = begin; v < end; ++v) {
      const auto star = adjacency_.Star(v);
      if (star.empty()) continue;
      ++part_.used_vertices;
      blamed_here_ = false;
      is_ignored_ = v == ignored_;
      if (k_ == 2)
        CheckCircle(v, star);
      else if (k_ == 3)
        CheckSphere(v, star);
      else
        CheckLink(FaceOf(v), {star.begin(), star.end()});
    }
    return std::move(part_);
  }

 private:
  using Star = std::span<const std::uint32_t>;

  static Face FaceOf(std::uint32_t v) {
    Face face;
    face.ids[face.size++] = v;
    return face;
  }

  // Checks the link of a vertex, k = 2: going round it from triangle to triangle passes all of
  // them.
  void CheckCircle(std::uint32_t v, Star star) {
    std::size_t passed = 0;
    std::uint32_t last = Adjacency::kNone;
    std::uint32_t s = star.front();
    do {
      const std::uint32_t* across = adjacency_.Across(s);
      const int a = list_[s][0] == v ? 1 : 0;  // the two triangles beside s that have v
      const int b = list_[s][2] == v ? 1 : 2;
      if (across[a] == Adjacency::kNone || across[b] == Adjacency::kNone) {
        Blame(FaceOf(v), kNotClosed);
        return;
      }
      const std::uint32_t next = across[a] == last ? across[b] : across[a];
      last = s;
      s = next;
      ++passed;
    } while (s != star.front());
    if (passed < star.size()) Blame(FaceOf(v), kSeveralParts);
  }

  // The same for k = 3: a flood of the link's triangles finds its vertices too, as each but the
  // first triangle is reached across an edge and can bring one new vertex.
  void CheckSphere(std::uint32_t v, Star star) {
    simplex_index_.Clear(star.size());
    vertex_index_.Clear(star.size());
    stack_.assign(1, star.front());
    simplex_index_.Number(star.front());
    for (int i = 0; i <= 3; ++i) vertex_index_.Number(list_[star.front()][i]);
    while (!stack_.empty()) {
      const std::uint32_t s = stack_.back();
      stack_.pop_back();
      for (int i = 0; i <= 3; ++i) {
        if (list_[s][i] == v) continue;
        const std::uint32_t t = adjacency_.Across(s, i);
        if (t == Adjacency::kNone) return CheckLink(FaceOf(v), {star.begin(), star.end()});
        const std::uint32_t known = simplex_index_.size();
        if (simplex_index_.Number(t) < known) continue;
        vertex_index_.Number(list_[t][adjacency_.Apex(s, t)]);
        stack_.push_back(t);
      }
    }
    if (simplex_index_.size() < star.size())
      return CheckLink(FaceOf(v), {star.begin(), star.end()});
    const std::int64_t vertices = vertex_index_.size() - 1;  // without v
    part_.link_vertices += vertices;
    CheckSurface(FaceOf(v), vertices, static_cast<std::int64_t>(star.size()));
  }

  // V - E + F with E = 3 F / 2. A closed connected surface pinched somewhere has less than its
  // normalisation, so 2 means a sphere.
  void CheckSurface(const Face& face, std::int64_t vertices, std::int64_t triangles) {
    if (2 * vertices - triangles != 4) {
      Blame(face, "is not a sphere: wrong Euler characteristic");
    }
  }

  // Vertices ascending of the link of `face`.
  std::vector<std::uint32_t> LinkVertices(const Face& face, const SimplexIds& simplices) const {
    std::vector<std::uint32_t> vertices;
    vertices.reserve(simplices.size() * k_);
    for (const std::uint32_t s : simplices) {
      for (int i = 0; i <= k_; ++i) {
        if (!face.Has(list_[s][i])) vertices.push_back(list_[s][i]);
      }
    }
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
  }

  // Each ridge of the link is in two of its simplices, and from one all others are reached
  // across ridges. `simplices` ascend.
  const char* WhyNotClosedAndConnected(const Face& face, const SimplexIds& simplices) {
    std::size_t reached = 1;
    stack_.assign(1, simplices.front());
    flooded_.assign(simplices.size(), 0);
    flooded_[0] = 1;
    while (!stack_.empty()) {
      const std::uint32_t s = stack_.back();
      stack_.pop_back();
      for (int i = 0; i <= k_; ++i) {
        if (face.Has(list_[s][i])) continue;
        const std::uint32_t t = adjacency_.Across(s, i);
        if (t == Adjacency::kNone) return kNotClosed;
        const auto at = std::lower_bound(simplices.begin(), simplices.end(), t);
        std::uint8_t& flooded = flooded_[static_cast<std::size_t>(at - simplices.begin())];
        if (flooded) continue;
        flooded = 1;
        ++reached;
        stack_.push_back(t);
      }
    }
    return reached == simplices.size() ? nullptr : kSeveralParts;
  }

  // Is the link of `face`, which all of `simplices` have, a sphere? If not, the vertices of the
  // face have bad links. Faces of higher dimension are checked from their lowest vertex alone.
  void CheckLink(const Face& face, const SimplexIds& simplices) {
    const int n = k_ - face.size;  // dimension of the link
    if (const char* why = WhyNotClosedAndConnected(face, simplices)) {
      Blame(face, why);
      // Counting goes on: the Euler characteristic is that of the complex as it is.
    }
    if (n < 2) return;
    const std::vector<std::uint32_t> vertices = LinkVertices(face, simplices);
    const std::int64_t top = static_cast<std::int64_t>(simplices.size());
    const std::int64_t f0 = static_cast<std::int64_t>(vertices.size());
    if (face.size == 1) part_.link_vertices += f0;
    if (n == 2) {
      CheckSurface(face, f0, top);
      return;
    }
    CheckFacesAround(face, simplices);
    CheckLoops(face, simplices, vertices);
  }

  void CheckFacesAround(const Face& face, const SimplexIds& simplices) {
    std::vector<std::uint64_t> pairs;  // (next vertex of a larger face, simplex)
    for (const std::uint32_t s : simplices) {
      for (int i = 0; i <= k_; ++i) {
        const std::uint32_t w = list_[s][i];
        if (w > face.ids[face.size - 1]) pairs.push_back(std::uint64_t{w} << 32 | s);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    SimplexIds around;
    for (std::size_t i = 0; i < pairs.size();) {
      const std::uint32_t w = static_cast<std::uint32_t>(pairs[i] >> 32);
      around.clear();
      for (; i < pairs.size() && pairs[i] >> 32 == w; ++i) {
        around.push_back(static_cast<std::uint32_t>(pairs[i]));
      }
      CheckLink(face.With(w), around);
    }
  }

  void CheckLoops(const Face& face, const SimplexIds& simplices,
                  const std::vector<std::uint32_t>& vertices) {
    const TwoSkeleton skeleton = LinkSkeleton(face, simplices, vertices);
    const std::int64_t f0 = skeleton.vertices;
    const std::int64_t f1 = static_cast<std::int64_t>(skeleton.edges.size());
    const std::int64_t f2 = static_cast<std::int64_t>(skeleton.triangles.size());
    const std::int64_t top = static_cast<std::int64_t>(simplices.size());
    if (face.size == 1) {
      part_.link_edges += f1;
      part_.link_triangles += f2;
      if (blamed_here_) return;
    }
    // A closed 3-manifold always has Euler characteristic 0; a closed 4-manifold without first
    // homology and of Euler characteristic 2 has no second homology either.
    if (k_ - face.size == 4 && 2 * (f0 - f1 + f2) - 5 * top + 2 * top != 4) {
      Blame(face, "is not a sphere: wrong Euler characteristic");
      return;
    }
    switch (ClassifyLoops(skeleton)) {
      case LoopVerdict::kSimplyConnected:
        break;
      case LoopVerdict::kNoHomology:
        part_.report.decided_exactly = false;
        break;
      case LoopVerdict::kHasHomology:
        Blame(face, "is not a sphere: it has loops that do not contract");
        break;
    }
  }

  TwoSkeleton LinkSkeleton(const Face& face, const SimplexIds& simplices,
                           const std::vector<std::uint32_t>& vertices) const {
    using Edge = std::array<std::uint32_t, 2>;
    using Triangle = std::array<std::uint32_t, 3>;
    TwoSkeleton skeleton;
    skeleton.vertices = static_cast<std::uint32_t>(vertices.size());
    std::vector<Triangle> corners;
    for (const std::uint32_t s : simplices) {
      std::array<std::uint32_t, kMaxDimension + 1> local{};
      int n = 0;
      for (int i = 0; i <= k_; ++i) {
        if (face.Has(list_[s][i])) continue;
        local[n++] = static_cast<std::uint32_t>(
            std::lower_bound(vertices.begin(), vertices.end(), list_[s][i]) - vertices.begin());
      }
      for (int a = 0; a < n; ++a) {
        for (int b = a + 1; b < n; ++b) {
          skeleton.edges.push_back({local[a], local[b]});
          for (int c = b + 1; c < n; ++c) corners.push_back({local[a], local[b], local[c]});
        }
      }
    }
    const auto sort_unique = [](auto& items) {
      std::sort(items.begin(), items.end());
      items.erase(std::unique(items.begin(), items.end()), items.end());
    };
    sort_unique(skeleton.edges);
    sort_unique(corners);
    const auto edge_number = [&](std::uint32_t a, std::uint32_t b) {
      return static_cast<std::uint32_t>(
          std::lower_bound(skeleton.edges.begin(), skeleton.edges.end(), Edge{a, b}) -
          skeleton.edges.begin());
    };
    skeleton.triangles.reserve(corners.size());
    for (const auto& [a, b, c] : corners) {
      skeleton.triangles.push_back({edge_number(a, b), edge_number(a, c), edge_number(b, c)});
    }
    return skeleton;
  }

  void Blame(const Face& face, const char* why) {
    if (is_ignored_) return;
    part_.blamed.insert(part_.blamed.end(), face.ids.begin(), face.ids.begin() + face.size);
    blamed_here_ = true;
    if (!part_.report.first_bad_link.empty()) return;
    part_.report.first_bad_link =
        face.size == 1
            ? Message("the link of vertex ", face.ids[0], " ", why)
            : Message("the link of face ", NameSimplex(face.ids.data(), face.size), " ", why);
  }

  const Adjacency& adjacency_;
  const SimplexList& list_;
  const int k_;
  const std::uint32_t ignored_;
  bool is_ignored_ = false;  // the vertex at hand
  LinksOfPart part_;
  bool blamed_here_ = false;           // the vertex at hand
  std::vector<std::uint8_t> flooded_;  // by simplex of the link at hand
  std::vector<std::uint32_t> stack_;
  SmallIndex simplex_index_, vertex_index_;
};

// A j-face is in the links of its j+1 vertices as a (j-1)-face.
std::int64_t EulerCharacteristic(const Adjacency& adjacency, const LinksOfPart& all) {
  const int k = adjacency.list().k;
  std::array<std::int64_t, kMaxDimension + 1> f{};
  f[0] = all.used_vertices;
  if (k >= 3) f[1] = all.link_vertices / 2;
  if (k >= 4) f[2] = all.link_edges / 3;
  if (k >= 5) f[3] = all.link_triangles / 4;
  if (k >= 2) f[k - 1] = static_cast<std::int64_t>(adjacency.facets());
  f[k] = adjacency.list().size();
  std::int64_t chi = 0;
  for (int j = 0; j <= k; ++j) chi += j % 2 == 0 ? f[j] : -f[j];
  return chi;
}

}  // namespace

LinkReport CheckLinks(const Adjacency& adjacency, std::uint32_t ignored) {
  const std::uint32_t vertices = adjacency.list().vertices;
  std::vector<LinksOfPart> parts(ChunkCount(vertices));
  ParallelChunks(vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] = LinkChecker(adjacency, ignored)
                       .Run(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
  });
  LinksOfPart all;
  for (LinksOfPart& part : parts) {
    ThrowIfInterrupted();
    all.used_vertices += part.used_vertices;
    all.link_vertices += part.link_vertices;
    all.link_edges += part.link_edges;
    all.link_triangles += part.link_triangles;
    all.blamed.insert(all.blamed.end(), part.blamed.begin(), part.blamed.end());
    all.report.decided_exactly = all.report.decided_exactly && part.report.decided_exactly;
    if (all.report.first_bad_link.empty())
      all.report.first_bad_link = std::move(part.report.first_bad_link);
  }
  std::sort(all.blamed.begin(), all.blamed.end());
  all.blamed.erase(std::unique(all.blamed.begin(), all.blamed.end()), all.blamed.end());
  std::erase(all.blamed, ignored);
  all.report.bad_links = all.blamed.size();
  AppendFirst(all.blamed, Violations::kMost, &all.report.some_bad);
  all.report.euler_characteristic = EulerCharacteristic(adjacency, all);
  return std::move(all.report);
}

}  // namespace stellate::core
