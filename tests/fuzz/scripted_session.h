#pragma once

#include <memory>
#include <string>

#include "server/session/session.h"
#include "tests/fuzz/target.h"

namespace stellate::fuzz {

// A mesh of the sphere, small enough for a fuzzer.
server::SessionOptions SmallSphere();

// Points and simplices as the history gives them, as one string; requires that it fits what the
// session says of itself.
std::string GeometryOf(const server::Session& session);

// Runs a session with workers that a script directs, chunk by chunk: they answer truly, wrongly,
// twice, late, never, with others' leases, come, go, and cancel. Everything happens on the calling
// thread, except limits of a few milliseconds that end what is never answered. A script that is
// used up answers truly. Requires what holds whatever the script.
struct Played {
  bool truthful = true;    // nothing was said that is not so, and nobody ended it
  bool cancelled = false;  // by the script
};
Played Play(server::Session* session, Script* script);

// The byte of a script at which the server stops.
char SuspendAct();

}  // namespace stellate::fuzz
