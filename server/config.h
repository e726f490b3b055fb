#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/specification.h"
#include "core/status.h"
#include "server/log.h"

namespace stellate::server {

// Where to listen: a TCP host and port, or a unix socket.
struct ListenAddress {
  std::string unix_path;  // set: a unix socket
  std::string host;       // brackets taken off
  int port = 0;           // 0: any free one

  bool IsUnix() const { return !unix_path.empty(); }
  bool IsLoopback() const;     // reachable from this machine alone
  std::string Target() const;  // as gRPC writes it
};

// "host:port", "[v6]:port", "unix:/path". `flag` is what a refusal names.
core::Expected<ListenAddress> ParseListenAddress(const std::string& text,
                                                 const std::string& flag = "--listen");

// Everything that can be set, with its default. Times in seconds.
struct Config {
  std::string listen = "127.0.0.1:7717";
  bool insecure_listen = false;         // plain text beyond this machine
  std::string ready_file;               // written with the address once the server listens
  std::string data_dir;                 // of the journal; empty: meshes live in memory alone
  std::uint64_t max_journal_bytes = 0;  // 0: what the disk holds

  std::string tls_certificate, tls_key;  // PEM files; empty: plain text
  std::string tls_client_ca;             // PEM file; clients need a certificate of this authority
  std::string token_file;                // lines "owner token"; empty: no tokens
  std::string metrics_listen;            // host:port for Prometheus; empty: none

  std::size_t max_meshes = 64;  // running at once
  std::uint64_t max_vertices = 10'000'000;
  std::uint64_t max_coordinates = std::uint64_t{1} << 30;  // vertices x d of one mesh: its memory
  int max_ambient_dimension = core::kMaxAmbientDimension;
  std::uint64_t max_rounds = 100'000;
  std::size_t max_message_bytes = std::size_t{4} << 20;
  std::size_t max_workers = 64;   // of one mesh
  std::size_t max_watchers = 64;  // of one mesh

  double worker_wait_seconds = 60;  // when the client does not say
  double answer_seconds = 60;       // when the client does not say
  double max_wait_seconds = 3600;   // most that a client may ask for either
  double keep_finished_seconds = 3600;
  std::size_t keep_finished_meshes = 32;
  double hello_seconds = 10;  // for a worker's first message

  double drain_seconds = 10;  // for running meshes to end, after SIGTERM
  double keepalive_seconds = 2;
  double keepalive_timeout_seconds = 5;

  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;
};

// kInvalidArgument naming the flag, its value and what to do.
core::Status Validate(const Config& config);

// Arrays travel in chunks of about this size.
std::size_t ChunkBytes(const Config& config);

}  // namespace stellate::server
