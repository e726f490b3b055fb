#include "server/flags.h"

#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "server/server.h"

namespace stellate::server {

ParsedFlags ParseFlags(int argc, char** argv) {
  static const std::map<std::string, LogLevel> kLevels = {
      {"trace", LogLevel::kTrace},     {"debug", LogLevel::kDebug}, {"info", LogLevel::kInfo},
      {"warning", LogLevel::kWarning}, {"error", LogLevel::kError}, {"off", LogLevel::kOff}};
  static const std::map<std::string, LogFormat> kFormats = {{"text", LogFormat::kText},
                                                            {"json", LogFormat::kJson}};
  ParsedFlags parsed;
  Flags& flags = parsed.flags;
  Config& config = flags.config;
  CLI::App app("stellated: meshes smooth manifolds for clients that serve their oracles.");
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", std::string("stellated ") + Version());

  app.add_option("--listen", config.listen,
                 "HOST:PORT, [IPV6]:PORT or unix:/PATH; port 0 takes a free one. Printed on "
                 "standard output as \"stellated listening on ADDRESS\"");
  app.add_flag("--insecure-listen", config.insecure_listen,
               "Allow plain text on an address that other machines reach");
  app.add_option("--ready-file", config.ready_file,
                 "File to write the address to, once the server listens");
  app.add_option("--data-dir", config.data_dir,
                 "Directory to record meshes in, so that they outlive the server; without it they "
                 "live in memory alone");
  app.add_flag("--health-check", flags.health_check,
               "Ask the server at --listen whether it serves; exit 0 if so, else 1");
  app.add_flag("--exit-with-parent", flags.exit_with_parent,
               "Stop when the process that started this one is gone");

  const auto safety = "Safety";
  app.add_option("--tls-cert", config.tls_certificate,
                 "PEM file with the server's certificate, and its chain: TLS instead of plain text")
      ->group(safety);
  app.add_option("--tls-key", config.tls_key, "PEM file with its private key")->group(safety);
  app.add_option("--tls-client-ca", config.tls_client_ca,
                 "PEM file: clients must show a certificate of one of these authorities. Its "
                 "subject owns the client's meshes, unless there is a --token-file")
      ->group(safety);
  app.add_option("--token-file", config.token_file,
                 "File of lines \"OWNER TOKEN\": clients must send one of these tokens, and see "
                 "their owner's meshes alone. Read again when it changes, or after SIGHUP")
      ->group(safety);
  app.add_option("--metrics-listen", config.metrics_listen,
                 "HOST:PORT to answer Prometheus at, http://HOST:PORT/metrics; default: nowhere");

  const auto limits = "Limits";
  app.add_option("--max-meshes", config.max_meshes, "Meshes running at once")->group(limits);
  app.add_option("--max-vertices", config.max_vertices, "Vertices of a mesh")->group(limits);
  app.add_option("--max-coordinates", config.max_coordinates,
                 "Vertices times ambient dimension of a mesh: bounds its memory")
      ->group(limits);
  app.add_option("--max-ambient-dimension", config.max_ambient_dimension, "Largest d")
      ->group(limits);
  app.add_option("--max-rounds", config.max_rounds, "Rounds of a mesh")->group(limits);
  app.add_option("--max-message-bytes", config.max_message_bytes, "Largest message, both ways")
      ->group(limits);
  app.add_option("--max-journal-bytes", config.max_journal_bytes,
                 "Size of the record in --data-dir; 0: what the disk holds")
      ->group(limits);
  app.add_option("--max-workers", config.max_workers, "Workers of a mesh")->group(limits);
  app.add_option("--max-watchers", config.max_watchers, "Watchers of a mesh")->group(limits);

  const auto times = "Times, in seconds";
  app.add_option("--worker-wait", config.worker_wait_seconds,
                 "How long a mesh waits for a worker, unless its client says")
      ->group(times);
  app.add_option("--answer-seconds", config.answer_seconds,
                 "How long a worker may take for a chunk, unless its client says")
      ->group(times);
  app.add_option("--max-wait", config.max_wait_seconds, "Most that a client may ask for either")
      ->group(times);
  app.add_option("--keep-finished-seconds", config.keep_finished_seconds,
                 "How long a finished mesh can be read")
      ->group(times);
  app.add_option("--keep-finished-meshes", config.keep_finished_meshes,
                 "How many finished meshes can be read")
      ->group(limits);
  app.add_option("--hello-seconds", config.hello_seconds, "Time for a worker's first message")
      ->group(times);
  app.add_option("--drain-seconds", config.drain_seconds,
                 "Time for running meshes to end after SIGTERM; a second signal ends it")
      ->group(times);
  app.add_option("--keepalive", config.keepalive_seconds, "Time between pings to a silent client")
      ->group(times);
  app.add_option("--keepalive-timeout", config.keepalive_timeout_seconds,
                 "Time for a client to answer a ping; then it counts as gone")
      ->group(times);

  app.add_option("--log-level", config.log_level, "trace, debug, info, warning, error or off")
      ->transform(CLI::CheckedTransformer(kLevels, CLI::ignore_case).description(""))
      ->default_str("info");
  app.add_option("--log-format", config.log_format, "text or json, on standard error")
      ->transform(CLI::CheckedTransformer(kFormats, CLI::ignore_case).description(""))
      ->default_str("text");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    parsed.exit_status = app.exit(error) == 0 ? 0 : 2;
  }
  return parsed;
}

}  // namespace stellate::server
