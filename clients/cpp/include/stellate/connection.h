#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "stellate/error.h"

namespace stellate {

// A length of time: `connection.reconnect = std::chrono::minutes(10)`, or Seconds(0.5).
using Seconds = std::chrono::duration<double>;

// For a server that requires TLS or a token. Empty: plain text. Any tls_ file implies TLS.
struct Credentials {
  bool tls = false;                      // TLS, trusting the system's authorities
  std::string tls_ca;                    // PEM file: trust these instead
  std::string tls_certificate, tls_key;  // PEM files, for a server that asks for a certificate
  std::string token;                     // over plain text only within this machine
};

// The span that meshes are part of, in the traces of a server that has some: W3C's two
// headers, as OpenTelemetry's propagator fills them in (docs/running/traces.md). Empty: none.
struct TraceContext {
  std::string traceparent, tracestate;
};

// A server that went away: restarted, frozen, or cut off.
struct Outage {
  bool over = false;    // it is back, and the mesh goes on
  Seconds lasted{0};    // since the server was lost
  int attempts = 0;     // at coming back to it
  std::string message;  // how it was lost, in gRPC's words
};

// The server to use, and what to do when it goes away.
//
//   options.connection.server = "mesher.example.org:7717";
//   options.connection.credentials.tls = true;
struct Connection {
  std::string server;  // "host:port" or "unix:/path"
  Credentials credentials = {};
  // How long to wait for a server that goes away; its streams are then opened again and continued.
  // Zero: do not wait. A server that cannot be reached at the start, or refuses, is an error
  // without a wait.
  Seconds reconnect{180};
  // Called on the calling thread at every failed attempt to come back, and when it succeeded.
  std::function<void(const Outage&)> on_outage = {};
  // A server that is silent for so long is pinged, and lost if it does not answer in twice that
  // time.
  Seconds keepalive{4};
  TraceContext trace = {};  // sent with every call
};

}  // namespace stellate
