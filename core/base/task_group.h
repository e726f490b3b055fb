#pragma once

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task_group.h>

#include "core/base/interruption.h"

namespace stellate::core {

// What an interruption ends. Here, so that no more of our sources than those that start tasks have
// to read oneTBB.
struct Interruption::Group {
  tbb::task_group_context context{tbb::task_group_context::isolated};
};

}  // namespace stellate::core
#endif
