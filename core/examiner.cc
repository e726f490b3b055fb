#include "core/examiner.h"

#include "core/examination/laws.h"

namespace stellate::core {

std::unique_ptr<Examiner> Examiner::Create(Specification spec, std::optional<double> epsilon) {
  return std::make_unique<examination::Laws>(std::move(spec), epsilon);
}

}  // namespace stellate::core
