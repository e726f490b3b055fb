#pragma once

#include "server/base/clock.h"

namespace stellate::server::testing {

// Time is a number where no test waits.
inline TimePoint At(Clock::duration since) { return TimePoint{} + since; }

}  // namespace stellate::server::testing
