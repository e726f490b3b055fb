#pragma once

#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>

#include <array>
#include <memory>
#include <mutex>
#include <string>

#include "core/status.h"
#include "server/config/config.h"

namespace stellate::server {

// The server's certificate, its key, and the authorities of clients. The files are read again when
// they change, so that a renewed certificate needs no restart; files that cannot be used change
// nothing, all of them, and are logged once. Any thread.
class TlsFiles {
 public:
  // Plain text without --tls-cert. kInvalidArgument: a file cannot be used, and why.
  static core::Expected<std::unique_ptr<TlsFiles>> Open(const Config& config);
  ~TlsFiles();

  // TLS by the files as they stand and as they will, within seconds of a Reload; with
  // --tls-client-ca for clients that have a certificate of that authority alone. This must outlive
  // the servers that listen with them.
  std::shared_ptr<grpc::ServerCredentials> Credentials() const;

  // Reads the files again if one is another than before, or in any case where `force`.
  void Reload(bool force = false);

  // Where the text in force of a file stands, for this process.
  enum File { kCertificate, kKey, kClientCa };
  std::string PathOf(File file) const;

 private:
  static constexpr std::size_t kFiles = 3;
  using Texts = std::array<std::string, kFiles>;

  explicit TlsFiles(const Config& config);
  std::array<std::string, kFiles> Stamps() const;
  core::Expected<Texts> Read() const;
  core::Status TakeOver(const Texts& texts);

  const std::array<std::string, kFiles> paths_;  // empty: there is none
  std::array<int, kFiles> copies_;               // files in memory, with what is in force
  std::mutex mutex_;                             // of Reload
  std::array<std::string, kFiles> stamps_;       // of what was read last
};

// For the server's own health check, which sends nothing worth hiding and may dial an address that
// the certificate does not name: takes any certificate, and shows the server's own.
std::shared_ptr<grpc::ChannelCredentials> SelfCheckCredentials(const Config& config);

}  // namespace stellate::server
