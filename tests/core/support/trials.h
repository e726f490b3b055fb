#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <string>

namespace stellate::core::testing {

inline std::uint64_t TrialSetting(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text ? std::strtoull(text, nullptr, 10) : otherwise;
}

// Calls trial(seed) for a few seeds, each named by what fails in it. STELLATE_PROPERTY_TRIALS says
// how many, STELLATE_PROPERTY_SEED where to begin (target property_campaign).
template <typename Trial>
void ForEachTrial(std::uint64_t by_default, const Trial& trial) {
  const std::uint64_t first = TrialSetting("STELLATE_PROPERTY_SEED", 1);
  const std::uint64_t trials = TrialSetting("STELLATE_PROPERTY_TRIALS", by_default);
  for (std::uint64_t seed = first; seed < first + trials; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    trial(seed);
  }
}

}  // namespace stellate::core::testing
