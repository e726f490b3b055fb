#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stellate::core {

// Appends ids until there are `most` in all. Call it for the parts of a mesh in their order.
inline void AppendFirst(const std::vector<std::uint32_t>& ids, std::size_t most,
                        std::vector<std::uint32_t>* all) {
  const std::size_t missing = most - std::min(most, all->size());
  all->insert(all->end(), ids.begin(),
              ids.begin() + static_cast<std::ptrdiff_t>(std::min(missing, ids.size())));
}

}  // namespace stellate::core
