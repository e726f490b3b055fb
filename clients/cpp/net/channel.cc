#include "net/channel.h"

#include <grpc/compression.h>
#include <grpc/grpc.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/client_interceptor.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "shared/reconnect.h"
#include "shared/retries.h"

namespace stellate::client {
namespace {

using Headers = std::vector<std::pair<std::string, std::string>>;

// Of every call. gRPC's own call credentials are refused on plain text even within one machine.
class SendHeaders final : public grpc::experimental::Interceptor {
 public:
  explicit SendHeaders(const Headers& headers) : headers_(headers) {}
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->insert(headers_.begin(), headers_.end());
    }
    methods->Proceed();
  }

 private:
  const Headers& headers_;
};

class SendHeadersFactory final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit SendHeadersFactory(Headers headers) : headers_(std::move(headers)) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo*) override {
    return new SendHeaders(headers_);
  }

 private:
  const Headers headers_;
};

}  // namespace

bool StaysOnThisMachine(const std::string& server) {
  if (server.rfind("unix:", 0) == 0) return true;
  const std::string host = server.substr(0, server.rfind(':'));
  const bool number = host.find_first_not_of("0123456789.") == std::string::npos;
  return host == "localhost" || host == "[::1]" || (number && host.rfind("127.", 0) == 0);
}

namespace {

Expected<std::string> Read(const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (text.empty()) return Fail(ErrorCode::kRefused, path + " cannot be read, or is empty");
  return text;
}

Expected<std::shared_ptr<grpc::ChannelCredentials>> Security(const Credentials& credentials) {
  const bool tls = credentials.tls || !credentials.tls_ca.empty() ||
                   !credentials.tls_certificate.empty() || !credentials.tls_key.empty();
  if (!tls) return grpc::InsecureChannelCredentials();
  if (credentials.tls_certificate.empty() != credentials.tls_key.empty()) {
    return Fail(ErrorCode::kRefused, "a client certificate and its key go together: give both");
  }
  grpc::SslCredentialsOptions options;
  const std::pair<const std::string&, std::string&> files[] = {
      {credentials.tls_ca, options.pem_root_certs},
      {credentials.tls_certificate, options.pem_cert_chain},
      {credentials.tls_key, options.pem_private_key}};
  for (const auto& [path, text] : files) {
    Expected<std::string> read = Read(path);
    if (!read) return tl::unexpected(read.error());
    text = std::move(*read);
  }
  return grpc::SslCredentials(options);
}

// The token and the trace. kRefused for what gRPC would end the program for.
Expected<Headers> HeadersOf(const Connection& connection) {
  const Credentials& credentials = connection.credentials;
  Headers headers;
  if (!credentials.token.empty()) {
    const bool plain =
        !credentials.tls && credentials.tls_ca.empty() && credentials.tls_certificate.empty();
    if (plain && !StaysOnThisMachine(connection.server)) {
      return Fail(ErrorCode::kRefused,
                  "the token would go to " + connection.server +
                      " in plain text, for others to read and use: turn TLS on");
    }
    headers.emplace_back("authorization", "Bearer " + credentials.token);
  }
  const auto& [traceparent, tracestate] = connection.trace;
  for (const auto& [name, value] :
       {std::pair("traceparent", traceparent), std::pair("tracestate", tracestate)}) {
    if (value.empty()) continue;
    if (std::any_of(value.begin(), value.end(), [](char c) { return c < ' ' || c > '~'; }))
      return Fail(ErrorCode::kRefused, std::string(name) + " has to be printable ASCII");
    headers.emplace_back(name, value);
  }
  return headers;
}

constexpr int Milliseconds(double seconds) { return static_cast<int>(1000 * seconds); }

}  // namespace

const std::chrono::milliseconds kCallTime{Milliseconds(reconnect::kCall)};

Expected<std::shared_ptr<grpc::Channel>> Connect(const Connection& connection) {
  const auto security = Security(connection.credentials);
  if (!security) return tl::unexpected(security.error());
  Expected<Headers> headers = HeadersOf(connection);
  if (!headers) return tl::unexpected(headers.error());
  std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>> interceptors;
  if (!headers->empty())
    interceptors.push_back(std::make_unique<SendHeadersFactory>(*std::move(headers)));
  KeepGrpc();
  grpc::ChannelArguments arguments;
  // Streams are quiet while the other side computes: pings find a peer that froze or vanished.
  const int ping = std::max(1, Milliseconds(std::min(connection.keepalive, kNoPings).count()));
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, ping);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS,
                   static_cast<int>(reconnect::kPingPatience * ping));
  arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // as many as it takes
  // gRPC unpacks a message before it measures it, and no server of ours packs any.
  arguments.SetInt(GRPC_COMPRESSION_CHANNEL_ENABLED_ALGORITHMS_BITSET, 1 << GRPC_COMPRESS_NONE);
  // The pauses between attempts are ours to choose, and gRPC's own would be up to two minutes.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS,
                   Milliseconds(reconnect::kFirstConnectionPause));
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS,
                   Milliseconds(reconnect::kLongestConnectionPause));
  arguments.SetServiceConfigJSON(reconnect::kRetries);  // a reply that was lost on the way
  return grpc::experimental::CreateCustomChannelWithInterceptors(
      connection.server, *security, arguments, std::move(interceptors));
}

void KeepGrpc() {
  static const bool kept = (grpc_init(), true);
  static_cast<void>(kept);
}

}  // namespace stellate::client
