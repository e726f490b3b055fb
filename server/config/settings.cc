#include "server/config/settings.h"

#include <limits>
#include <type_traits>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;

constexpr double kYear = 366 * 86400.0;  // seconds
constexpr double kMoment = 0.001;
constexpr double kBytes = 1e15;  // more than there is
constexpr double kMebibyte = 1024.0 * 1024.0;
constexpr bool kLive = true;

constexpr char kSafety[] = "Safety";
constexpr char kServerLimits[] = "Limits of the server";
constexpr char kOwnerLimits[] = "Limits of each owner, where clients are authenticated";
constexpr char kMeshLimits[] = "Limits of each mesh";
constexpr char kWorkers[] = "Workers";
constexpr char kTimes[] = "Times, in seconds";
constexpr char kLogs[] = "Logs, metrics and traces";

constexpr std::pair<LogLevel, const char*> kLevels[] = {
    {LogLevel::kTrace, "trace"},     {LogLevel::kDebug, "debug"}, {LogLevel::kInfo, "info"},
    {LogLevel::kWarning, "warning"}, {LogLevel::kError, "error"}, {LogLevel::kOff, "off"}};
constexpr std::pair<LogFormat, const char*> kFormats[] = {{LogFormat::kText, "text"},
                                                          {LogFormat::kJson, "json"}};

template <typename T, std::size_t n>
const char* NameIn(const std::pair<T, const char*> (&names)[n], T value) {
  for (const auto& [candidate, name] : names) {
    if (candidate == value) return name;
  }
  return nullptr;
}

template <typename T, std::size_t n>
bool ReadIn(const std::pair<T, const char*> (&names)[n], const std::string& text, T* value) {
  for (const auto& [candidate, name] : names) {
    if (text != name) continue;
    *value = candidate;
    return true;
  }
  return false;
}

// The file knows no escapes, so a quote is of the kind that the text does not hold.
std::string Quoted(const std::string& text) {
  const char quote = text.find('"') == std::string::npos ? '"' : '\'';
  return quote + text + quote;
}

std::string TextOf(const Config& config, const Setting& setting) {
  return std::visit(
      [&config](auto field) -> std::string {
        const auto& value = config.*field;
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, std::string>) return Quoted(value);
        if constexpr (std::is_same_v<T, bool>) return value ? "true" : "false";
        if constexpr (std::is_same_v<T, LogLevel>) return Quoted(LogLevelName(value));
        if constexpr (std::is_same_v<T, LogFormat>) return Quoted(LogFormatName(value));
        if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) return Message(value);
      },
      setting.field);
}

}  // namespace

const std::vector<Setting>& Settings() {
  static const std::vector<Setting> settings = {
      {"", "--listen", &Config::listen,
       "HOST:PORT, [IPV6]:PORT or unix:/PATH; port 0 takes a free one. Printed on standard output "
       "as \"stellated listening on ADDRESS\""},
      {"", "--ready-file", &Config::ready_file,
       "File to write the address to, once the server listens"},
      {"", "--data-dir", &Config::data_dir,
       "Directory to record meshes in, so that they outlive the server; without it they live in "
       "memory alone"},
      {"", "--database", &Config::database,
       "Record meshes in PostgreSQL instead: a URL, postgresql://USER@HOST/NAME, or a file that "
       "holds one, as it must where there is a password in it. Any number of servers may share a "
       "database, and take over each other's meshes"},
      {"", "--peer-address", &Config::peer_address,
       "HOST:PORT at which the other servers of --database reach this one; empty: that of "
       "--listen, "
       "with this machine's name where it listens on all its addresses"},

      {kSafety, "--insecure-listen", &Config::insecure_listen,
       "Allow plain text on an address that other machines reach"},
      {kSafety, "--tls-cert", &Config::tls_certificate,
       "PEM file with the server's certificate, and its chain: TLS instead of plain text"},
      {kSafety, "--tls-key", &Config::tls_key, "PEM file with its private key"},
      {kSafety, "--tls-client-ca", &Config::tls_client_ca,
       "PEM file: clients must show a certificate of one of these authorities. Its subject owns "
       "the client's meshes, unless there is a --token-file"},
      {kSafety, "--token-file", &Config::token_file,
       "File of lines \"OWNER TOKEN\": clients must send one of these tokens, and see their "
       "owner's meshes alone. With \"weight=N\" behind, N from 1 to 1000, an owner has N times the "
       "processor time of one without, where they contend for it. Read again when it changes, or "
       "after SIGHUP"},

      {kServerLimits, "--max-meshes", &Config::max_meshes,
       "Meshes running at a time; of several servers on a --database each its own", 1, 100'000,
       kLive},
      {kServerLimits, "--max-processors", &Config::max_processors,
       "Processors that compute meshes at a time; 0: as many as the machine or container has", 0,
       4096},
      {kServerLimits, "--max-memory-bytes", &Config::max_memory_bytes,
       "Estimated memory of all meshes; 0: three quarters of what the machine or container has", 0,
       kBytes, kLive},
      {kServerLimits, "--max-journal-bytes", &Config::max_journal_bytes,
       "Size of the record in --data-dir or --database; 0: what there is room for", 0, kBytes},
      {kServerLimits, "--max-message-bytes", &Config::max_message_bytes,
       "Largest message, both ways", kMebibyte, 1024 * kMebibyte},
      {kServerLimits, "--max-unread-bytes", &Config::max_unread_bytes,
       "Memory for requests that have begun to come and are not whole yet, of all TCP connections; "
       "beyond it those are closed that hold most for longest",
       16 * kMebibyte, kBytes},
      {kServerLimits, "--max-connections", &Config::max_connections,
       "Connections open at a time; further ones are closed", 1, 1'000'000},
      {kServerLimits, "--max-connection-streams", &Config::max_connection_streams,
       "Calls open at a time on one connection; more wait in the client. A TCP connection with 256 "
       "more that are open, or reset and not done with, is closed",
       4, 1'000'000},

      {kOwnerLimits, "--owner-meshes", &Config::owner_meshes,
       "Meshes running at a time, on all servers of a --database together; 0: as many as the "
       "server "
       "allows",
       0, 100'000, kLive},
      {kOwnerLimits, "--keep-finished-meshes", &Config::keep_finished_meshes,
       "Finished meshes that can be read, of all clients together where they are not "
       "authenticated. "
       "What is beyond is forgotten, first what has no vertex, nothing else within a minute of its "
       "end. Each server of a --database counts its own",
       0, 1'000'000, kLive},
      {kOwnerLimits, "--owner-memory-bytes", &Config::owner_memory_bytes,
       "Estimated memory of an owner's meshes; 0: half of the server's", 0, kBytes, kLive},
      {kOwnerLimits, "--owner-journal-bytes", &Config::owner_journal_bytes,
       "Size of an owner's records; 0: half of --max-journal-bytes, or of what the disk of "
       "--data-dir has for them at the start, or no limit with --database",
       0, kBytes},

      {kMeshLimits, "--max-vertices", &Config::max_vertices, "Vertices", 1,
       std::numeric_limits<std::uint32_t>::max(), kLive},
      {kMeshLimits, "--max-coordinates", &Config::max_coordinates,
       "Vertices times ambient dimension", 1, static_cast<double>(std::uint64_t{1} << 48), kLive},
      {kMeshLimits, "--max-dimension", &Config::max_dimension, "Largest k", 1,
       static_cast<double>(core::LargestDimension()), kLive},
      {kMeshLimits, "--max-ambient-dimension", &Config::max_ambient_dimension, "Largest d", 2,
       core::kMaxAmbientDimension, kLive},
      {kMeshLimits, "--max-rounds", &Config::max_rounds, "Rounds", 1,
       static_cast<double>(std::uint64_t{1} << 40), kLive},
      {kMeshLimits, "--max-workers", &Config::max_workers, "Workers at a time", 1, 100'000, kLive},
      {kMeshLimits, "--max-watchers", &Config::max_watchers, "Watchers at a time", 1, 100'000,
       kLive},

      {kWorkers, "--max-in-flight", &Config::max_in_flight,
       "Chunks of queries that one worker holds at a time", 1, 64, kLive},
      {kWorkers, "--check-share", &Config::check_share,
       "Share of the queries that is asked of two workers, where there are several, to compare "
       "the answers; 0: none",
       0, 1, kLive},

      {kTimes, "--worker-wait", &Config::worker_wait_seconds,
       "How long a mesh waits for a worker, unless its client says", kMoment, kYear, kLive},
      {kTimes, "--answer-seconds", &Config::answer_seconds,
       "How long a worker may take for a chunk, or since it last said that it is busy with it, "
       "unless its client says",
       kMoment, kYear, kLive},
      {kTimes, "--busy-seconds", &Config::busy_seconds,
       "How long a worker may take for a chunk in all, unless its client says", kMoment, kYear,
       kLive},
      {kTimes, "--max-wait", &Config::max_wait_seconds,
       "Most that a client may ask for of these three; 0: an hour, and 30 days with --data-dir or "
       "--database",
       0, kYear, kLive},
      {kTimes, "--keep-finished-seconds", &Config::keep_finished_seconds,
       "How long a finished mesh can be read", 0, kYear, kLive},
      {kTimes, "--hello-seconds", &Config::hello_seconds,
       "Time for a connection's handshake, and for a worker's first message", kMoment, kYear},
      {kTimes, "--request-seconds", &Config::request_seconds,
       "Time for a request to be whole; a TCP connection that began one and finished none is "
       "closed",
       kMoment, kYear},
      {kTimes, "--unread-seconds", &Config::unread_seconds,
       "How long a watcher may leave a message unread; then its stream ends as CANCELLED, and it "
       "may come back with the last revision that it has",
       kMoment, kYear, kLive},
      {kTimes, "--database-patience", &Config::database_patience_seconds,
       "How long a --database that does not answer is waited for, by a mesh before it fails, and "
       "by a server that starts",
       0, kYear},
      {kTimes, "--drain-seconds", &Config::drain_seconds,
       "Time for meshes that are served to end after SIGTERM; a second signal ends it", 0, kYear,
       kLive},
      {kTimes, "--keepalive", &Config::keepalive_seconds, "Time between pings to a silent client",
       0.1, kYear},
      {kTimes, "--keepalive-timeout", &Config::keepalive_timeout_seconds,
       "Time for a client to answer a ping; then it counts as gone", 0.1, kYear},

      {kLogs, "--metrics-listen", &Config::metrics_listen,
       "HOST:PORT to answer Prometheus at, http://HOST:PORT/metrics; default: nowhere"},
      {kLogs, "--traces-to", &Config::traces_to,
       "http://HOST:PORT, or https:// for TLS, of a collector of OpenTelemetry that takes OTLP "
       "over gRPC, to send spans of meshes to; default: what OTEL_EXPORTER_OTLP_ENDPOINT says, or "
       "nowhere"},
      {kLogs, "--log-level", &Config::log_level, "trace, debug, info, warning, error or off", 0, 0,
       kLive},
      {kLogs, "--log-format", &Config::log_format, "text or json, on standard error"},
  };
  return settings;
}

core::Status CheckRanges(const Config& config) {
  for (const Setting& setting : Settings()) {
    std::string complaint;
    std::visit(
        [&](auto field) {
          using T = std::decay_t<decltype(config.*field)>;
          if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
            const auto value = static_cast<double>(config.*field);
            if (value >= setting.least && value <= setting.most) return;
            complaint =
                Message(setting.flag, " is ", config.*field, " but must be from ",
                        static_cast<T>(setting.least), " to ", static_cast<T>(setting.most));
          }
        },
        setting.field);
    if (!complaint.empty()) return {core::StatusCode::kInvalidArgument, std::move(complaint)};
  }
  return core::Status::Ok();
}

std::string ToConfigFile(const Config& config) {
  std::string text = "# stellated --config FILE. Flags on the command line come first.\n";
  const char* group = "";
  for (const Setting& setting : Settings()) {
    if (setting.group != group) text += Message("\n# ", setting.group, "\n");
    group = setting.group;
    text += Message("\n# ", setting.help, setting.live ? ". SIGHUP reads it again" : "", "\n",
                    setting.Key(), " = ", TextOf(config, setting), "\n");
  }
  return text;
}

Changes TakeOver(const Config& next, Config* config) {
  Changes changes;
  for (const Setting& setting : Settings()) {
    std::visit(
        [&](auto field) {
          if (next.*field == config->*field) return;
          if (!setting.live) return changes.at_next_start.push_back(setting.Key());
          config->*field = next.*field;
          changes.taken.push_back(Message(setting.Key(), " = ", TextOf(next, setting)));
        },
        setting.field);
  }
  return changes;
}

const char* LogLevelName(LogLevel level) { return NameIn(kLevels, level); }
const char* LogFormatName(LogFormat format) { return NameIn(kFormats, format); }
bool ReadLogLevel(const std::string& name, LogLevel* level) { return ReadIn(kLevels, name, level); }
bool ReadLogFormat(const std::string& name, LogFormat* format) {
  return ReadIn(kFormats, name, format);
}

}  // namespace stellate::server
