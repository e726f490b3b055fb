#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "stellate/client.h"
#include "stellate/error.h"

namespace stellate::client {

// A channel to the server that sends the token, if there is one, with every call. kRefused: a file
// that cannot be read, or a token that others could read on its way.
Expected<std::shared_ptr<grpc::Channel>> Connect(const std::string& server,
                                                 const Credentials& credentials);

}  // namespace stellate::client
