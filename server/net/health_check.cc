#include "server/net/health_check.h"

#include <google/protobuf/wrappers.pb.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <future>
#include <utility>
#include <vector>

#include "core/base/message.h"

namespace stellate::server {
namespace {

// grpc.health.v1 is not among Debian's C++ headers; its two messages are one field each.
constexpr char kMethod[] = "/grpc.health.v1.Health/Check";
constexpr std::string_view kServing("\x08\x01", 2);  // HealthCheckResponse{status: SERVING}

}  // namespace

std::string CheckHealth(const std::string& target, std::chrono::milliseconds limit,
                        const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                        const std::string& service) {
  const auto channel = grpc::CreateChannel(target, credentials);
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + limit);
  google::protobuf::StringValue question;  // on the wire what HealthCheckRequest{service} is
  question.set_value(service);
  const grpc::Slice slice(question.SerializeAsString());
  grpc::ByteBuffer request(&slice, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> promise;
  stub.UnaryCall(&context, kMethod, grpc::StubOptions(), &request, &response,
                 [&promise](grpc::Status status) { promise.set_value(std::move(status)); });
  const grpc::Status status = promise.get_future().get();  // the deadline bounds it
  if (!status.ok()) return core::Message(target, " does not answer: ", status.error_message());
  std::vector<grpc::Slice> slices;
  std::string bytes;
  if (!response.Dump(&slices).ok()) return core::Message(target, " answers nonsense");
  for (const grpc::Slice& part : slices) {
    bytes.append(reinterpret_cast<const char*>(part.begin()), part.size());
  }
  return bytes == kServing ? "" : core::Message(target, " is not serving");
}

}  // namespace stellate::server
