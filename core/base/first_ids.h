#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stellate::core {

// Appends ids, no more than make it `most` in all: what parts of a mesh have to say, in their
// order.
inline void AppendFirst(const std::vector<std::uint32_t>& ids, std::size_t most,
                        std::vector<std::uint32_t>* all) {
  const std::size_t missing = most - std::min(most, all->size());
  all->insert(all->end(), ids.begin(),
              ids.begin() + static_cast<std::ptrdiff_t>(std::min(missing, ids.size())));
}

}  // namespace stellate::core
