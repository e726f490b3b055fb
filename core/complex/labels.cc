#include "core/complex/labels.h"

#include <algorithm>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"

namespace stellate::core {
namespace {

template <int K>
bool Holds(const Stars<K>& stars, std::uint32_t p, int sector, const std::uint32_t* simplex) {
  const auto& cell = stars.cell(p, sector);
  typename Stars<K>::Simplex dual;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (stars.SimplexOf(p, cell, v, &dual) && std::equal(dual.begin(), dual.end(), simplex))
      return true;
  return false;
}

bool HasLabel(const Sectors& sectors, std::uint32_t p, int label) {
  for (int sector = 0; sector < sectors.Count(p); ++sector)
    if (sectors.Label(p, sector) == label) return true;
  return false;
}

}  // namespace

template <int K>
int LabelOf(const Stars<K>& stars, const std::uint32_t* simplex) {
  const Sectors& sectors = stars.sample().sectors();
  const std::uint32_t p = simplex[0];
  const int last = sectors.Count(p) - 1;
  for (int sector = last; sector > 0; --sector)
    if (Holds(stars, p, sector, simplex)) return sectors.Label(p, sector);
  if (last == 0 || Holds(stars, p, 0, simplex)) return sectors.Label(p, 0);
  for (int sector = last; sector > 0; --sector) {
    const int label = sectors.Label(p, sector);
    if (std::all_of(simplex + 1, simplex + K + 1,
                    [&](std::uint32_t q) { return HasLabel(sectors, q, label); }))
      return label;
  }
  return sectors.Label(p, 0);
}

template <int K>
std::vector<std::int8_t> LabelsOf(const Stars<K>& stars,
                                  const std::vector<std::uint32_t>& simplices) {
  std::vector<std::int8_t> labels;
  if (stars.sample().sectors().labels().empty()) return labels;
  labels.resize(simplices.size() / (K + 1));
  ParallelFor(labels.size(), [&](std::size_t i) {
    labels[i] = static_cast<std::int8_t>(LabelOf(stars, simplices.data() + i * (K + 1)));
  });
  return labels;
}

#define STELLATE_EACH(K)                                       \
  template int LabelOf(const Stars<K>&, const std::uint32_t*); \
  template std::vector<std::int8_t> LabelsOf(const Stars<K>&, const std::vector<std::uint32_t>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
