#pragma once

#include <chrono>

#include "server/base/clock.h"

namespace stellate::server {

inline double Seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace stellate::server
