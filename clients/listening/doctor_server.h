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
  // Files of TLS, without which it listens where this machine alone can reach it. With
  // `tls_client_ca` workers show certificates of that authority.
  std::string tls_certificate, tls_key, tls_client_ca;
  std::uint64_t random_seed = 1;  // of the questions
  std::function<void(const std::string& address)> on_listening;
  std::function<void(const CheckReport&)> on_report;  // one at a time, on any thread
  std::function<bool()> goes_on;                      // asked ten times a second
};

// Serves examinations until `goes_on` returns false, behind the bounds of a server
// (server/net/guarded_server.h). kRefused where it cannot listen, or should not.
Expected<void> RunDoctor(const DoctorOptions& options);

std::string ToJson(const CheckReport& report);  // as doctor.proto has it, indented

}  // namespace stellate
