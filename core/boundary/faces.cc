#include "core/boundary/faces.h"

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"

namespace stellate::core {

template <int K>
std::vector<FaceMesh> FacesOf(const Stars<K>& stars) {
  using Simplex = std::array<std::uint32_t, K + 1>;  // as many of them as the face has corners
  using Sides = std::pair<int, int>;                 // of a wall: labels; of other faces: none
  std::map<std::tuple<int, WallSet, Sides>, std::vector<Simplex>> faces;
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
      const auto& cell = stars.cell(p, sector);
      for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
        const auto simplex = stars.FaceSimplexOf(p, cell, v);
        if (simplex.walls == 0 || simplex.fake || simplex.ids[0] != p ||
            stars.sample().sectors().Piece(p, sector, simplex.walls) == 0)
          continue;
        // A corner of more walls than K has several vertices of its cell at itself.
        const WallSet walls = simplex.dimension() == 0 ? stars.sample().walls(p) : simplex.walls;
        const bool is_side = CountWalls(walls) == 1 && !stars.sample().sectors().labels().empty();
        const Sides sides = is_side ? stars.sample().sectors().labels().Sides(
                                          walls, stars.sample().sectors().SignsOf(p, sector))
                                    : Sides(0, 1);
        Simplex& corners = faces[{simplex.dimension(), walls, sides}].emplace_back();
        std::copy_n(simplex.ids.begin(), simplex.count, corners.begin());
      }
    }
  }
  std::vector<FaceMesh> all;
  for (auto& [key, simplices] : faces) {
    std::sort(simplices.begin(), simplices.end());
    simplices.erase(std::unique(simplices.begin(), simplices.end()), simplices.end());
    const auto& [dimension, walls, sides] = key;
    FaceMesh face{walls, dimension, {}, sides, {}, {}, {}};
    for (const Simplex& s : simplices)
      face.simplices.insert(face.simplices.end(), s.begin(), s.begin() + dimension + 1);
    all.push_back(std::move(face));
  }
  return all;
}

#define STELLATE_EACH(K) template std::vector<FaceMesh> FacesOf<K>(const Stars<K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
