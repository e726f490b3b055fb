#pragma once

#include <chrono>

namespace stellate::server {

using Clock = std::chrono::steady_clock;
using TimePoint = Clock::time_point;

}  // namespace stellate::server
