#pragma once

#include <string>

#include "net/reconnect.h"
#include "run/host.h"
#include "stellate/client.h"
#include "stellate/error.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

// What a server is asked for: options without any that are still to be chosen.
struct Request {
  MeshOptions options;
  std::string epsilon_reason;  // empty where epsilon was given
};

// Has the host choose epsilon where it is automatic, and chooses what suits where the server is: on
// this machine, if none is named.
Expected<Request> Settle(const Host& host, Oracle& oracle, const MeshOptions& options);

// Sets the epsilon that was chosen, and reports it.
void Take(const ChosenEpsilon& chosen, Request* request);

// Adds to a report why the epsilon of its mesh was chosen, which the server does not know; empty:
// it was given.
void Tell(const std::string& epsilon_reason, Report* report);

// A new mesh, as the server says it. Where a server that was reached is lost, the call is repeated
// as `policy` has it: an id of its own lets the server know the mesh again. options.stop ends the
// wait.
Expected<v1::Mesh> CreateMesh(v1::Stellate::Stub& stub, Oracle& oracle, const MeshOptions& options,
                              const ReconnectPolicy& policy);

}  // namespace stellate::client
