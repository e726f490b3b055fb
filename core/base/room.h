#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace stellate::core {

// For a vector that is almost all there is to come: room for one part in `parts` more. It has up to
// as much again where it grew one by one, and would take that at the next one where it did not.
template <typename T>
void LeaveRoom(std::size_t parts, std::vector<T>* vector) {
  std::vector<T> fitting;
  fitting.reserve(vector->size() + vector->size() / parts);
  fitting.assign(vector->begin(), vector->end());
  vector->swap(fitting);
}

// For a vector of all there is that is about to grow by `more`: where it must be moved, it gets a
// little more room, and not as much again as it has.
template <typename T>
void MakeRoom(std::size_t more, std::vector<T>* vector) {
  constexpr std::size_t kParts = 8;
  const std::size_t size = vector->size();
  if (size + more > vector->capacity()) vector->reserve(size + std::max(more, size / kParts));
}

}  // namespace stellate::core
