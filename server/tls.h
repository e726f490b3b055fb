#pragma once

#include <grpcpp/security/credentials.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "core/status.h"
#include "server/config.h"

namespace stellate::server {

// Plain text without --tls-cert; else TLS, and with --tls-client-ca for clients that have a
// certificate of that authority alone. The files are read again when they change, so that a
// renewed certificate needs no restart. kInvalidArgument: a file cannot be used, and why.
core::Expected<std::shared_ptr<grpc::ServerCredentials>> ListenCredentials(const Config& config);

// For the server's own health check, which sends nothing worth hiding and may dial an address that
// the certificate does not name: takes any certificate, and shows the server's own.
std::shared_ptr<grpc::ChannelCredentials> SelfCheckCredentials(const Config& config);

}  // namespace stellate::server
