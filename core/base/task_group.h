#pragma once

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task_group.h>

#include "core/base/interruption.h"

namespace stellate::core {

// The tasks that an interruption ends. In a header of its own, so that only sources that start
// tasks include oneTBB.
struct Interruption::Group {
  tbb::task_group_context context{tbb::task_group_context::isolated};
};

}  // namespace stellate::core
#endif
