#include "server/base/allocator.h"

#include <malloc.h>

namespace stellate::server {

void GiveBackLargeBlocks() {
  // Larger ones are few beside the work done in them; either call also ends the learning.
  constexpr int kLargeBytes = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargeBytes);
  mallopt(M_TRIM_THRESHOLD, kLargeBytes);
}

}  // namespace stellate::server
