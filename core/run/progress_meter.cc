#include "core/run/progress_meter.h"

#include <algorithm>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"

namespace stellate::core {

template <int K>
void Measure(const Engine<K>& engine, bool is_certifying, double to_lay, Progress* progress) {
  const StarComplex<K>& complex = engine.complex();
  const ViolationBook<K>& book = engine.book();
  progress->vertices = complex.size();
  progress->simplices = engine.simplex_count();
  progress->phase = is_certifying         ? Phase::kCertifying
                    : complex.size() == 0 ? Phase::kSeeding
                                          : Phase::kRefining;
  progress->bad_size = progress->bad_radius_edge = progress->unbounded_stars = 0;
  std::size_t step = 0;
  for (const auto& entry : book.size_and_shape()) {
    CheckInterruption(step++);
    progress->unbounded_stars += !complex.cell(entry.star).bounded();
    ++(entry.violation.rule == Rule::kSize ? progress->bad_size : progress->bad_radius_edge);
  }
  progress->bad_sliver = book.slivers();
  progress->bad_inconsistent = book.inconsistent();
  // Half as many as would fill the flat cells: their points serve several.
  const double missing = to_lay + engine.CountMissing(0.5) + static_cast<double>(book.blemished());
  const double have = static_cast<double>(complex.size());
  const double share = is_certifying ? 0.99 : 0.98 * have / (have + missing + 1);
  progress->fraction = std::max(progress->fraction, share);
}

#define STELLATE_EACH(K) template void Measure<K>(const Engine<K>&, bool, double, Progress*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
