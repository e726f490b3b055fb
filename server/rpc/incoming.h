#pragma once

#include <grpcpp/impl/codegen/proto_utils.h>

namespace stellate::server {

// A message that a client sent on a stream, whether it is a `Message` or not. gRPC says of one that
// it cannot parse what it says of a stream that is over, which is no error.
template <typename Message>
struct Incoming {
  Message message;
  bool is_valid = false;  // else `message` holds nothing of use
};

}  // namespace stellate::server

namespace grpc {

template <typename Message>
class SerializationTraits<stellate::server::Incoming<Message>> {
 public:
  static Status Deserialize(ByteBuffer* buffer, stellate::server::Incoming<Message>* incoming) {
    incoming->is_valid = SerializationTraits<Message>::Deserialize(buffer, &incoming->message).ok();
    return Status::OK;
  }
};

}  // namespace grpc
