#include "stellate/doctor_server.h"

#include <google/protobuf/util/json_util.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <thread>

#include "net/channel.h"
#include "run/doctor_service.h"

namespace stellate {
namespace {

constexpr auto kLook = std::chrono::milliseconds(100);
constexpr int kLargestMessage = 64 << 20;

}  // namespace

Expected<void> RunDoctor(const DoctorOptions& options) {
  client::KeepGrpc();
  client::DoctorService service(options.random_seed, options.on_report);
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(), &port);
  builder.SetMaxReceiveMessageSize(kLargestMessage);
  builder.RegisterService(static_cast<v1::Stellate::Service*>(&service));
  builder.RegisterService(static_cast<v1::Doctor::Service*>(&service));
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (server == nullptr) {
    return Fail(ErrorCode::kRefused, "cannot listen on " + options.listen, "INVALID_ARGUMENT");
  }
  std::string address = options.listen;
  if (address.rfind("unix:", 0) != 0) {
    address = address.substr(0, address.rfind(':') + 1) + std::to_string(port);
  }
  options.on_listening(address);
  while (options.goes_on()) std::this_thread::sleep_for(kLook);
  server->Shutdown(std::chrono::system_clock::now());
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
