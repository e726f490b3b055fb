#include "server/net/tls.h"

#include <fcntl.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/mman.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <utility>

#include "core/base/message.h"
#include "server/base/file_stamp.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;
using core::StatusCode;
namespace tls = grpc::experimental;

constexpr unsigned kRefreshSeconds = 2;
constexpr const char* kFlags[] = {"--tls-cert", "--tls-key", "--tls-client-ca"};

template <typename T, auto kFree>
struct Freer {
  void operator()(T* pointer) const { kFree(pointer); }
};
using Text = std::unique_ptr<BIO, Freer<BIO, BIO_free>>;
using Certificate = std::unique_ptr<X509, Freer<X509, X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY, EVP_PKEY_free>>;

Text TextOf(const std::string& text) {
  return Text(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

// The certificates of a file; the first of them into `first`. None, or what is none among them:
// why.
std::string CheckCertificates(const std::string& pem, Certificate* first = nullptr) {
  const Text text = TextOf(pem);
  std::size_t count = 0;
  ERR_clear_error();
  while (Certificate certificate{PEM_read_bio_X509(text.get(), nullptr, nullptr, nullptr)}) {
    if (count++ == 0 && first != nullptr) *first = std::move(certificate);
  }
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  ERR_clear_error();  // it may quote the file
  if (count == 0) return "no PEM certificate can be read from it";
  if (at_end) return "";
  return Message("what follows its PEM certificate number ", count, " is damaged");
}

std::string CheckKey(const std::string& pem, X509* certificate) {
  // An empty password: a server has nobody to ask for one.
  const Key key(
      PEM_read_bio_PrivateKey(TextOf(pem).get(), nullptr, nullptr, const_cast<char*>("")));
  const bool fits = key && X509_check_private_key(certificate, key.get()) == 1;
  ERR_clear_error();
  if (!key) return "no PEM private key without a password can be read from it";
  return fits ? "" : "it is not the key of the certificate";
}

// The first certificate of a text; null: there is none.
Certificate FirstIn(const std::string& pem) {
  Certificate certificate;
  CheckCertificates(pem, &certificate);
  return certificate;
}

// Takes the certificate of a file, as it is now, and no other.
class SameCertificate final : public tls::ExternalCertificateVerifier {
 public:
  explicit SameCertificate(std::string path) : path_(std::move(path)) {}

  bool Verify(tls::TlsCustomVerificationCheckRequest* request,
              std::function<void(grpc::Status)> /*callback*/, grpc::Status* status) override {
    std::ifstream file(path_, std::ios::binary);
    const Certificate ours = FirstIn({std::istreambuf_iterator<char>(file), {}});
    const grpc::string_ref shown = request->peer_cert();
    const Certificate theirs = FirstIn({shown.data(), shown.size()});
    if (ours == nullptr || theirs == nullptr || X509_cmp(ours.get(), theirs.get()) != 0) {
      *status = {grpc::StatusCode::UNAUTHENTICATED,
                 "the other server has another certificate: all that share a database have one"};
    }
    return true;
  }
  void Cancel(tls::TlsCustomVerificationCheckRequest* /*request*/) override {}

 private:
  const std::string path_;
};

// Shows the server's own certificate.
tls::TlsChannelCredentialsOptions OwnOptions(const Config& config) {
  tls::TlsChannelCredentialsOptions options;
  // No root is consulted, but gRPC wants one, and without ours it fails where a machine has none.
  options.set_certificate_provider(std::make_shared<tls::FileWatcherCertificateProvider>(
      config.tls_key, config.tls_certificate, config.tls_certificate, kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  options.watch_root_certs();
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  return options;
}

}  // namespace

TlsFiles::TlsFiles(const Config& config)
    : paths_{config.tls_certificate, config.tls_key, config.tls_client_ca} {
  copies_.fill(-1);
}

TlsFiles::~TlsFiles() {
  for (const int copy : copies_) {
    if (copy >= 0) close(copy);
  }
}

core::Expected<std::unique_ptr<TlsFiles>> TlsFiles::Open(const Config& config) {
  std::unique_ptr<TlsFiles> files(new TlsFiles(config));
  if (config.tls_certificate.empty()) return files;
  files->stamps_ = files->Stamps();  // before reading: a change in between is found by Reload
  auto texts = files->Read();
  if (!texts) return tl::unexpected(std::move(texts.error()));
  Status status = files->TakeOver(*texts);
  OPENSSL_cleanse((*texts)[kKey].data(), (*texts)[kKey].size());
  if (!status.ok()) return tl::unexpected(std::move(status));
  return files;
}

std::array<std::string, TlsFiles::kFiles> TlsFiles::Stamps() const {
  std::array<std::string, kFiles> stamps;
  for (std::size_t i = 0; i < kFiles; ++i) stamps[i] = FileStamp(paths_[i]);
  return stamps;
}

// gRPC would take anything, and fail every handshake.
core::Expected<TlsFiles::Texts> TlsFiles::Read() const {
  Texts texts;
  for (std::size_t i = 0; i < kFiles; ++i) {
    std::ifstream file(paths_[i], std::ios::binary);
    texts[i] = std::string(std::istreambuf_iterator<char>(file), {});
  }
  Certificate certificate;
  std::array<std::string, kFiles> why;
  why[kCertificate] = CheckCertificates(texts[kCertificate], &certificate);
  if (certificate) why[kKey] = CheckKey(texts[kKey], certificate.get());
  if (!paths_[kClientCa].empty()) why[kClientCa] = CheckCertificates(texts[kClientCa]);
  for (std::size_t i = 0; i < kFiles; ++i) {
    if (why[i].empty()) continue;
    OPENSSL_cleanse(texts[kKey].data(), texts[kKey].size());
    return core::Refuse(StatusCode::kInvalidArgument,
                        Message(kFlags[i], " is ", paths_[i], " but ", why[i]));
  }
  return texts;
}

// gRPC reads the files in memory by themselves: each is exchanged whole, under the same number.
Status TlsFiles::TakeOver(const Texts& texts) {
  for (std::size_t i = 0; i < kFiles; ++i) {
    const int copy = memfd_create("stellated", MFD_CLOEXEC);
    const auto size = static_cast<ssize_t>(texts[i].size());
    if (copy < 0 || write(copy, texts[i].data(), texts[i].size()) != size) {
      if (copy >= 0) close(copy);
      return {StatusCode::kFailedPrecondition,
              Message("there is no memory for a copy of ", kFlags[i], " ", paths_[i])};
    }
    if (copies_[i] < 0) {
      copies_[i] = copy;
      continue;
    }
    dup3(copy, copies_[i], O_CLOEXEC);
    close(copy);
  }
  return Status::Ok();
}

std::string TlsFiles::PathOf(File file) const { return Message("/proc/self/fd/", copies_[file]); }

void TlsFiles::Reload(bool force) {
  if (paths_[kCertificate].empty()) return;
  const std::lock_guard lock(mutex_);
  auto stamps = Stamps();
  if (stamps == stamps_ && !force) return;
  stamps_ = std::move(stamps);
  auto texts = Read();
  Status status = texts ? TakeOver(*texts) : texts.error();
  if (texts) OPENSSL_cleanse((*texts)[kKey].data(), (*texts)[kKey].size());
  if (!status.ok()) {
    return Log(LogLevel::kError, {},
               "a file of TLS changed but cannot be used: those read before stay in force",
               LogFields().Add("why", status.message));
  }
  Log(LogLevel::kInfo, {}, "the files of TLS were read again");
}

std::shared_ptr<grpc::ServerCredentials> TlsFiles::Credentials() const {
  if (paths_[kCertificate].empty()) return grpc::InsecureServerCredentials();
  const bool ask = !paths_[kClientCa].empty();
  tls::TlsServerCredentialsOptions options(std::make_shared<tls::FileWatcherCertificateProvider>(
      PathOf(kKey), PathOf(kCertificate), ask ? PathOf(kClientCa) : "", kRefreshSeconds));
  options.watch_identity_key_cert_pairs();
  if (ask) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  } else {
    options.set_cert_request_type(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  }
  return tls::TlsServerCredentials(options);
}

std::shared_ptr<grpc::ChannelCredentials> SelfCheckCredentials(const Config& config) {
  if (config.tls_certificate.empty()) return grpc::InsecureChannelCredentials();
  tls::TlsChannelCredentialsOptions options = OwnOptions(config);
  options.set_certificate_verifier(std::make_shared<tls::NoOpCertificateVerifier>());
  return tls::TlsCredentials(options);
}

std::shared_ptr<grpc::ChannelCredentials> PeerCredentials(const Config& config) {
  if (config.tls_certificate.empty()) return grpc::InsecureChannelCredentials();
  tls::TlsChannelCredentialsOptions options = OwnOptions(config);
  options.set_certificate_verifier(
      tls::ExternalCertificateVerifier::Create<SameCertificate>(config.tls_certificate));
  return tls::TlsCredentials(options);
}

}  // namespace stellate::server
