#include "core/certificate/claims/closed_off.h"

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/certificate/complex/parts.h"

namespace stellate::core {
namespace {

using Ids = std::vector<std::uint32_t>;

// Counts the parts that the walls' signs leave of a region, or of M, at a vertex.
std::size_t PartsAt(const MeshView& mesh, std::uint32_t v, int label) {
  if (CountWalls(mesh.WallsOf(v)) < 2) return 1;
  const std::vector<std::size_t> roots = PartsOfSectors(SectorsAt(mesh, v, label));
  return std::max<std::size_t>(std::set<std::size_t>(roots.begin(), roots.end()).size(), 1);
}

Ids Without(const std::uint32_t* ids, std::size_t width, std::uint32_t left_out) {
  Ids rest;
  std::copy_if(ids, ids + width, std::back_inserter(rest),
               [&](std::uint32_t id) { return id != left_out; });
  return rest;
}

// The work of CloseOff on one complex.
class Closer {
 public:
  Closer(const MeshView& mesh, const Ids& simplices, int label)
      : mesh_(mesh),
        label_(label),
        width_(static_cast<std::size_t>(mesh.k) + 1),
        original_(simplices) {
    result_.ids = simplices;
  }

  ClosedOff Run(FunctionRef<bool(const FaceMesh&)> is_end) {
    for (std::uint32_t v = 0; mesh_.table && v < mesh_.vertices; ++v) {
      CheckInterruption(v);
      if (const std::size_t parts = PartsAt(mesh_, v, label_); parts > 1) Separate(v, parts);
    }
    if (!result_.copied.empty()) CountCopies();
    result_.apex = static_cast<std::uint32_t>(mesh_.vertices + result_.copied.size());
    result_.cones_at = result_.ids.size();
    for (const FaceMesh& face : *mesh_.faces)
      if (face.dimension == mesh_.k - 1 && is_end(face)) AddCones(face.simplices);
    for (std::size_t s = 0; !result_.copied.empty() && s < result_.cones_at; s += width_)
      std::sort(At(s), At(s + width_));
    return std::move(result_);
  }

 private:
  Ids::iterator At(std::size_t i) { return result_.ids.begin() + static_cast<std::ptrdiff_t>(i); }

  // Gives a vertex a copy for each part of its star but the first.
  void Separate(std::uint32_t v, std::size_t expected) {
    if (!stars_)
      stars_.emplace(SimplexList{mesh_.k, static_cast<std::uint32_t>(mesh_.vertices), &original_});
    const auto star = stars_->Star(v);
    Parts parts(star.size());
    std::map<Ids, std::size_t> facets;
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::uint32_t* ids = stars_->list()[star[m]];
      for (std::size_t i = 0; i < width_; ++i) {
        if (ids[i] == v) continue;
        const auto [known, is_new] = facets.emplace(Without(ids, width_, ids[i]), m);
        if (!is_new) parts.Join(known->second, m);
      }
    }
    if (parts.Count() != expected && result_.wrong_parts.empty())
      result_.wrong_parts = Message("the star of vertex ", v, " has ", parts.Count(),
                                    parts.Count() == 1 ? " part" : " parts",
                                    " where the walls' signs leave ", expected);
    std::map<std::size_t, std::uint32_t> copies;  // by root
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::size_t root = parts.Root(m);
      if (copies.empty()) copies[root] = v;
      const auto [copy, is_new] =
          copies.emplace(root, static_cast<std::uint32_t>(mesh_.vertices + result_.copied.size()));
      if (is_new) result_.copied.push_back(v);
      // Its place is that of the simplex's own ids until all are renamed.
      const std::uint32_t* ids = stars_->list()[star[m]];
      const std::size_t place = static_cast<std::size_t>(std::find(ids, ids + width_, v) - ids);
      result_.ids[star[m] * width_ + place] = copy->second;
    }
    pinched_.insert(v);
  }

  // Counts the faces, all of whose vertices were copied, with and without copies.
  void CountCopies() {
    std::set<Ids> with, without;
    for (std::size_t s = 0; s < original_.size(); s += width_)
      for (unsigned mask = 1; mask < 1u << width_; ++mask) {
        Ids copies, originals;
        bool all = true;
        for (std::size_t i = 0; i < width_ && all; ++i) {
          if ((mask >> i & 1u) == 0) continue;
          all = pinched_.contains(original_[s + i]);
          originals.push_back(original_[s + i]);
          copies.push_back(result_.ids[s + i]);
        }
        if (!all) continue;
        std::sort(copies.begin(), copies.end());
        with.insert(copies);
        without.insert(originals);
      }
    for (const auto& [faces, sign] : {std::pair(&with, 1), std::pair(&without, -1)})
      for (const Ids& face : *faces) result_.euler_of_copies += face.size() % 2 == 1 ? sign : -sign;
  }

  // Adds cones over the simplices of a face, k ids each, with the copies that the simplex has which
  // ends there.
  void AddCones(const Ids& facets) {
    const std::size_t k = width_ - 1;
    for (std::size_t f = 0; f < facets.size(); f += k) {
      const auto first = facets.begin() + static_cast<std::ptrdiff_t>(f);
      Ids base(first, first + static_cast<std::ptrdiff_t>(k));
      if (std::any_of(base.begin(), base.end(), [&](auto v) { return pinched_.contains(v); }))
        base = CopiesOf(base);
      result_.ids.insert(result_.ids.end(), base.begin(), base.end());
      result_.ids.push_back(result_.apex);
    }
  }

  Ids CopiesOf(const Ids& facet) const {
    for (const std::uint32_t s : stars_->Star(facet.front())) {
      const std::uint32_t* ids = stars_->list()[s];
      if (!std::includes(ids, ids + width_, facet.begin(), facet.end())) continue;
      Ids copies;
      for (std::size_t i = 0; i < width_; ++i)
        if (std::binary_search(facet.begin(), facet.end(), ids[i]))
          copies.push_back(result_.ids[s * width_ + i]);
      std::sort(copies.begin(), copies.end());
      return copies;
    }
    return facet;  // none ends there, which is refused
  }

  const MeshView& mesh_;
  const int label_;
  const std::size_t width_;
  const Ids& original_;
  std::optional<VertexStars> stars_;  // once a vertex is pinched
  std::set<std::uint32_t> pinched_;
  ClosedOff result_;
};

// Counts the faces with `size` vertices in a list of simplices.
std::int64_t CountFaces(std::size_t width, const Ids& simplices, int size) {
  std::vector<std::array<std::uint32_t, kMaxDimension>> parts;
  for (std::size_t s = 0; s < simplices.size(); s += width)
    for (unsigned mask = 1; mask < 1u << width; ++mask) {
      if (std::popcount(mask) != size) continue;
      std::size_t corners = 0;
      auto& part = parts.emplace_back();
      for (std::size_t i = 0; i < width; ++i)
        if (mask >> i & 1u) part[corners++] = simplices[s + i];
    }
  std::sort(parts.begin(), parts.end());
  return std::unique(parts.begin(), parts.end()) - parts.begin();
}

}  // namespace

std::vector<WallSet> SectorsOf(const LabelTable& table, WallSet walls, WallSet signs, int label) {
  std::vector<WallSet> sectors = table.Sectors(walls, signs);
  if (label != 0) std::erase_if(sectors, [&](WallSet sector) { return table.Of(sector) != label; });
  return sectors;
}

std::vector<WallSet> SectorsAt(const MeshView& mesh, std::uint32_t v, int label) {
  if (mesh.corner_sectors)
    if (const auto at = mesh.corner_sectors->find(v); at != mesh.corner_sectors->end()) {
      std::vector<WallSet> sectors = at->second;
      if (label != 0)
        std::erase_if(sectors, [&](WallSet sector) { return mesh.table->Of(sector) != label; });
      return sectors;
    }
  return SectorsOf(*mesh.table, mesh.WallsOf(v), mesh.signs[v], label);
}

std::vector<std::size_t> PartsOfSectors(const std::vector<WallSet>& sectors) {
  Parts parts(sectors.size());
  for (std::size_t i = 0; i < sectors.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (CountWalls(sectors[i] ^ sectors[j]) == 1) parts.Join(i, j);
  std::vector<std::size_t> roots(sectors.size());
  for (std::size_t i = 0; i < sectors.size(); ++i) roots[i] = parts.Root(i);
  return roots;
}

std::uint32_t ClosedOff::Original(std::uint32_t id) const {
  const auto vertices = static_cast<std::uint32_t>(apex - copied.size());
  return id < vertices ? id : id == apex ? vertices : copied[id - vertices];
}

std::vector<std::uint32_t> ClosedOff::Boundary(int k) const {
  Ids boundary;
  for (std::size_t s = cones_at; s < ids.size(); s += static_cast<std::size_t>(k) + 1) {
    const auto base = ids.begin() + static_cast<std::ptrdiff_t>(s);
    boundary.insert(boundary.end(), base, base + k);
  }
  return boundary;
}

// The complex without its cones has fewer faces: those that the cone over the boundary has in
// addition to the boundary.
std::int64_t ClosedOff::EulerOfRest(int k) const {
  if (cones_at == ids.size()) return -euler_of_copies;  // no cone, and no apex
  return ShapeOf(k - 1, Boundary(k)).euler_characteristic - 1 - euler_of_copies;
}

ClosedOff CloseOff(const MeshView& mesh, const std::vector<std::uint32_t>& simplices, int label,
                   FunctionRef<bool(const FaceMesh&)> is_end) {
  return Closer(mesh, simplices, label).Run(is_end);
}

Shape ShapeOf(int dimension, const std::vector<std::uint32_t>& simplices) {
  const auto width = static_cast<std::size_t>(dimension) + 1;
  Ids vertices = simplices;
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  Parts parts(vertices.size());
  const auto place = [&](std::uint32_t id) {
    return static_cast<std::size_t>(std::lower_bound(vertices.begin(), vertices.end(), id) -
                                    vertices.begin());
  };
  for (std::size_t s = 0; s < simplices.size(); s += width)
    for (std::size_t i = 1; i < width; ++i)
      parts.Join(place(simplices[s]), place(simplices[s + i]));
  Shape shape;
  shape.components = parts.Count();
  for (int size = 1; size <= dimension + 1; ++size)
    shape.euler_characteristic += (size % 2 == 1 ? 1 : -1) * CountFaces(width, simplices, size);
  return shape;
}

}  // namespace stellate::core
