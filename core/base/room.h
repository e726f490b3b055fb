#pragma once

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

}  // namespace stellate::core
