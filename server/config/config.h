#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/specification.h"
#include "core/status.h"
#include "server/base/log.h"

namespace stellate::server {

// All settings of a server, with their defaults; settings.cc explains each. Times in seconds.
struct Config {
  std::string listen = "127.0.0.1:7717";
  bool insecure_listen = false;  // plain text beyond this machine
  std::string ready_file;        // written with the address once the server listens
  std::string data_dir;          // of the journal; empty: meshes live in memory alone,
  std::string database;          // or in PostgreSQL: a URL, or a file that holds one
  std::string peer_address;      // where other servers of the database reach it; empty: at listen

  std::string tls_certificate, tls_key;  // PEM files; empty: plain text
  std::string tls_client_ca;             // PEM file; clients need a certificate of this authority
  std::string token_file;                // lines "owner token"; empty: no tokens
  std::string metrics_listen;            // host:port for Prometheus; empty: none
  std::string traces_to;                 // URL of a collector; empty: as the environment says

  // Of the server.
  std::uint64_t max_meshes = 64;        // running at a time
  std::uint64_t max_processors = 0;     // that compute; 0: WithDefaults says
  std::uint64_t max_memory_bytes = 0;   // of all meshes, estimated; 0: WithDefaults says
  std::uint64_t max_journal_bytes = 0;  // 0: what the disk holds
  std::uint64_t max_message_bytes = std::uint64_t{4} << 20;
  std::uint64_t max_unread_bytes = std::uint64_t{64} << 20;  // of incomplete requests
  std::uint64_t max_connections = 2048;                      // over TCP
  std::uint64_t max_connection_streams = 1024;

  // Of each owner, where clients are authenticated.
  std::uint64_t owner_meshes = 32;  // running at a time; 0: as many as the server
  std::uint64_t keep_finished_meshes = 32;
  std::uint64_t owner_memory_bytes = 0;   // 0: WithDefaults says
  std::uint64_t owner_journal_bytes = 0;  // 0: half of what the record may have

  // Of each mesh.
  std::uint64_t max_vertices = 10'000'000;
  std::uint64_t max_coordinates = std::uint64_t{1} << 30;  // vertices x d
  int max_dimension = core::LargestDimension();
  int max_ambient_dimension = core::kMaxAmbientDimension;
  std::uint64_t max_rounds = 100'000;
  std::uint64_t max_workers = 64;
  std::uint64_t max_watchers = 64;

  int max_in_flight = 2;      // chunks that one worker holds
  double check_share = 0.01;  // of the queries, asked of two workers

  double worker_wait_seconds = 60;  // when the client does not say
  double answer_seconds = 60;       // when the client does not say
  double busy_seconds = 3600;       // when the client does not say
  double max_wait_seconds = 0;      // most that a client may ask for of these; 0: MaxWaitSeconds
  double keep_finished_seconds = 3600;
  double hello_seconds = 10;    // for a worker's first message
  double request_seconds = 60;  // for a request to be complete
  double unread_seconds = 600;  // for a watcher to read a message

  double database_patience_seconds = 3600;  // for --database to answer

  double drain_seconds = 10;  // for running meshes to end, after SIGTERM
  double keepalive_seconds = 2;
  double keepalive_timeout_seconds = 5;

  LogLevel log_level = LogLevel::kInfo;
  LogFormat log_format = LogFormat::kText;

  bool operator==(const Config&) const = default;
};

// kInvalidArgument, with the flag, its value and what to do.
core::Status Validate(const Config& config);

// Whether meshes outlive the server.
inline bool IsDurable(const Config& config) {
  return !config.data_dir.empty() || !config.database.empty();
}

// Replaces zeros that stand for a part of this machine, or of another limit, by numbers.
Config WithDefaults(Config config);

// The longest wait that a client may ask for: by default an hour, or 30 days where meshes are
// recorded, since batch queues take their time.
inline double MaxWaitSeconds(const Config& config) {
  if (config.max_wait_seconds > 0) return config.max_wait_seconds;
  return IsDurable(config) ? 30 * 86400.0 : 3600;
}

// Arrays travel in chunks of about this size.
std::size_t ChunkBytes(const Config& config);
// Largest part of a mesh that is sent to a client, which may read it slowly or not at all.
std::size_t PartBytes(const Config& config);

}  // namespace stellate::server
