#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stellate::core {

// Call it on a vector that is almost complete: sets the capacity to its size and one part in
// `parts` more. A vector that grew one by one may hold twice its size, and one that did not would
// double at the next push_back.
template <typename T>
void FitCapacity(std::size_t parts, std::vector<T>* vector) {
  std::vector<T> fitting;
  fitting.reserve(vector->size() + vector->size() / parts);
  fitting.assign(vector->begin(), vector->end());
  vector->swap(fitting);
}

// Call it before a large vector grows by `more`: if it must be moved, reserves a little more than
// that, instead of twice its size.
template <typename T>
void ReserveMore(std::size_t more, std::vector<T>* vector) {
  constexpr std::size_t kParts = 8;
  const std::size_t size = vector->size();
  if (size + more > vector->capacity()) vector->reserve(size + std::max(more, size / kParts));
}

}  // namespace stellate::core
