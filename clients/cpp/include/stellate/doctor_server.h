#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "stellate/doctor.h"
#include "stellate/error.h"

namespace stellate {

// A doctor for the oracles of workers, in whatever language, that come as to a server
// (doctor.proto).
struct DoctorOptions {
  std::string listen;  // "host:port", a port of 0 being any that is free, or "unix:/path"
  std::uint64_t random_seed = 1;  // of the questions
  std::function<void(const std::string& address)> on_listening;
  std::function<void(const CheckReport&)> on_report;  // one at a time, on any thread
  std::function<bool()> goes_on;                      // asked ten times a second
};

// Examines until it shall not go on. kRefused where it cannot listen.
Expected<void> RunDoctor(const DoctorOptions& options);

std::string ToJson(const CheckReport& report);  // as doctor.proto has it, indented

}  // namespace stellate
