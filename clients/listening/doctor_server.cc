#include "doctor_server.h"

#include <google/protobuf/util/json_util.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <string_view>
#include <thread>

#include "doctor_service.h"
#include "net/channel.h"
#include "server/net/guarded_server.h"

namespace stellate {
namespace {

constexpr auto kLook = std::chrono::milliseconds(100);
constexpr int kLooksATick = 10;
// Of a doctor's workers, who come one after the other.
constexpr std::uint64_t kMostConnections = 128, kMostCalls = 64;

tl::unexpected<Error> Refuse(const std::string& message) {
  return Fail(ErrorCode::kRefused, message, "INVALID_ARGUMENT");
}

Expected<server::Config> ConfigOf(const DoctorOptions& options) {
  const auto address = server::ParseListenAddress(options.listen);
  if (!address) return Refuse(address.error().message);
  if (options.tls_certificate.empty() != options.tls_key.empty())
    return Refuse("--tls-cert and --tls-key go together: give both or neither");
  if (options.tls_certificate.empty() && !options.tls_client_ca.empty())
    return Refuse("--tls-client-ca needs TLS: give --tls-cert and --tls-key too");
  if (options.tls_certificate.empty() && !address->IsLoopback()) {
    return Refuse("--listen is \"" + options.listen +
                  "\", which others can reach in plain text: give --tls-cert and --tls-key, or "
                  "listen on 127.0.0.1 or a unix socket");
  }
  server::Config config;
  config.listen = options.listen;
  config.tls_certificate = options.tls_certificate;
  config.tls_key = options.tls_key;
  config.tls_client_ca = options.tls_client_ca;
  config.max_connections = kMostConnections;
  config.max_connection_streams = kMostCalls;
  return config;
}

// It knows no tokens: whoever gets through may ask what it serves.
server::CallKind KindOf(std::string_view path, std::string_view /*authorization*/) {
  return path.starts_with("/stellate.v1.") ? server::CallKind::kAnybodys
                                           : server::CallKind::kRefused;
}

}  // namespace

Expected<void> RunDoctor(const DoctorOptions& options) {
  const Expected<server::Config> config = ConfigOf(options);
  if (!config) return tl::unexpected(config.error());
  client::KeepGrpc();
  client::DoctorService service(options.random_seed, options.on_report);
  grpc::ServerBuilder builder;
  builder.RegisterService(static_cast<v1::Stellate::Service*>(&service));
  builder.RegisterService(static_cast<v1::Doctor::Service*>(&service));
  const auto guarded = server::GuardedServer::Start(
      *config, &builder, {KindOf, [](const char* /*setting*/) {}, /*has_flags=*/false});
  if (!guarded) return Refuse(guarded.error().message);
  options.on_listening((*guarded)->address());
  for (int look = 1; options.goes_on(); ++look) {
    std::this_thread::sleep_for(kLook);
    if (look % kLooksATick == 0) (*guarded)->Tick();
  }
  (*guarded)->StopListening();
  (*guarded)->grpc().Shutdown(std::chrono::system_clock::now());
  return {};
}

std::string ToJson(const CheckReport& report) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string text;
  const auto written =
      google::protobuf::util::MessageToJsonString(client::ToProto(report), &text, options);
  return written.ok() ? text : "";
}

}  // namespace stellate
