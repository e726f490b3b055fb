#pragma once

#include <grpcpp/server_context.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

#include "core/status.h"
#include "server/auth/tokens.h"
#include "server/config/config.h"
#include "server/spans/trace_context.h"

namespace stellate::server {

// The caller of an rpc. Meshes belong to owners; an owner sees only their own.
struct Identity {
  std::string owner;  // empty: clients are not authenticated
  std::optional<TokenDigest> token;
  bool administrator = false;  // sees and ends the meshes of all owners
  bool is_passed_on = false;   // by another server, which knows the caller
  std::string address;         // then: where the call came from
  TraceHeaders trace{};        // that the call is a part of
};

// What servers know each other's calls by.
struct PeerTrust {
  std::string secret;
  // This server's, as calls to it have them.
  std::function<std::int64_t()> number, beat;
};

// Authenticates callers: by bearer token if there is a token file, else by the client certificate
// if those are asked for, else not at all. Any thread; never waits.
class Authenticator {
 public:
  static core::Expected<std::unique_ptr<Authenticator>> Create(const Config& config);

  // Before the first call: also takes calls that other servers pass on.
  void Trust(PeerTrust peers) { peers_ = std::move(peers); }

  // UNAUTHENTICATED: no token, or none that is known. Neither is logged.
  tl::expected<Identity, grpc::Status> Identify(const grpc::ServerContextBase& context) const;
  // False once the token was taken out of the file: for streams, which may outlive it.
  bool StillHolds(const Identity& identity) const;

  // Of processor time, where owners contend for it; 1 where the token file says nothing.
  double WeightOf(const std::string& owner) const;

  bool AsksForTokens() const { return tokens_ != nullptr; }
  // Whether it is of a token that is known; its value is the header's.
  bool Knows(std::string_view authorization) const;

  // Reads the token file again, if it changed or if `force`.
  void Reload(bool force = false);

 private:
  tl::expected<Identity, grpc::Status> IdentifyPassedOn(std::string_view authorization) const;

  PeerTrust peers_;  // empty: none
  std::unique_ptr<TokenFile> tokens_;
  bool by_certificate_ = false;
};

// UNAUTHENTICATED: the token was good once.
grpc::Status TokenWithdrawn();

}  // namespace stellate::server
