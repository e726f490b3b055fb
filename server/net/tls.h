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
// they change, so that a renewed certificate needs no restart. If one cannot be used, all stay as
// they were, and the log says so once. Any thread.
class TlsFiles {
 public:
  // Plain text without --tls-cert. kInvalidArgument: a file cannot be used, and why.
  static core::Expected<std::unique_ptr<TlsFiles>> Open(const Config& config);
  ~TlsFiles();

  // Credentials by the files in force, also after later Reloads, within seconds. With
  // --tls-client-ca only clients with a certificate of that authority are accepted. This must
  // outlive the servers that listen with them.
  std::shared_ptr<grpc::ServerCredentials> Credentials() const;

  // Reads the files again if one has changed, or if `force`.
  void Reload(bool force = false);

  // A path, for this process, of the version of a file that is in force.
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

// For calls to other servers that share a database, by whatever address: shows the server's own
// certificate, and takes no other than that, which all of them have.
std::shared_ptr<grpc::ChannelCredentials> PeerCredentials(const Config& config);

}  // namespace stellate::server
