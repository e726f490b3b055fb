#include "server/tls.h"

#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cstdio>
#include <string>

#include "core/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
namespace tls = grpc::experimental;

constexpr unsigned kRefreshSeconds = 2;

template <typename T, void (*kFree)(T*)>
struct Freer {
  void operator()(T* pointer) const { kFree(pointer); }
};
using Certificate = std::unique_ptr<X509, Freer<X509, X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY, EVP_PKEY_free>>;

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

Status Invalid(const char* flag, const std::string& path, const char* why) {
  ERR_clear_error();  // it may quote the file
  return {StatusCode::kInvalidArgument, Message(flag, " is ", path, " but ", why)};
}

Certificate ReadCertificate(const std::string& path) {
  const File file(std::fopen(path.c_str(), "re"));
  return Certificate(file ? PEM_read_X509(file.get(), nullptr, nullptr, nullptr) : nullptr);
}

// gRPC would start all the same and fail every handshake.
Status CheckFiles(const Config& config) {
  constexpr char kNoCertificate[] = "no PEM certificate can be read from it";
  const Certificate certificate = ReadCertificate(config.tls_certificate);
  if (!certificate) return Invalid("--tls-cert", config.tls_certificate, kNoCertificate);
  const File file(std::fopen(config.tls_key.c_str(), "re"));
  // An empty password: a server has nobody to ask for one.
  const Key key(file ? PEM_read_PrivateKey(file.get(), nullptr, nullptr, const_cast<char*>(""))
                     : nullptr);
  if (!key) {
    return Invalid("--tls-key", config.tls_key,
                   "no PEM private key without a password can be read from it");
  }
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    return Invalid("--tls-key", config.tls_key, "it is not the key of the certificate");
  }
  if (!config.tls_client_ca.empty() && !ReadCertificate(config.tls_client_ca)) {
    return Invalid("--tls-client-ca", config.tls_client_ca, kNoCertificate);
  }
  return Status::Ok();
}

}  // namespace

core::Expected<std::shared_ptr<grpc::ServerCredentials>> ListenCredentials(const Config& config) {
  if (config.tls_certificate.empty()) return grpc::InsecureServerCredentials();
  Status status = CheckFiles(config);
  if (!status.ok()) return tl::unexpected(std::move(status));
  tls::TlsServerCredentialsOptions options(std::make_shared<tls::FileWatcherCertificateProvider>(
      config.tls_key, config.tls_certificate, config.tls_client_ca, kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  if (config.tls_client_ca.empty()) {
    options.set_cert_request_type(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  } else {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return tls::TlsServerCredentials(options);
}

std::shared_ptr<grpc::ChannelCredentials> SelfCheckCredentials(const Config& config) {
  if (config.tls_certificate.empty()) return grpc::InsecureChannelCredentials();
  tls::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(std::make_shared<tls::FileWatcherCertificateProvider>(
      config.tls_key, config.tls_certificate, kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  options.set_verify_server_certs(false);
  options.set_certificate_verifier(std::make_shared<tls::NoOpCertificateVerifier>());
  options.set_check_call_host(false);
  return tls::TlsCredentials(options);
}

}  // namespace stellate::server
