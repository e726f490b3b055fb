#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "stellate/catalogue.h"

namespace stellate::testing {

// A manifold of the catalogue. Throws std::runtime_error with the catalogue's words if there is
// none of that name.
inline std::unique_ptr<Manifold> Make(const std::string& spec) {
  Expected<std::unique_ptr<Manifold>> manifold = MakeManifold(spec);
  if (!manifold) throw std::runtime_error(manifold.error().message);
  return std::move(*manifold);
}

}  // namespace stellate::testing
