#include "doctor_command.h"

#include <google/protobuf/util/json_util.h>
#include <grpc/grpc.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <csignal>
#include <iostream>
#include <memory>
#include <thread>
#include <utility>

#include "doctor_service.h"
#include "server_options.h"

namespace stellate::cli {
namespace {

constexpr auto kLook = std::chrono::milliseconds(100);
constexpr int kLargestMessage = 64 << 20;

}  // namespace

DoctorCommand::DoctorCommand(CLI::App& parent)
    : command_(parent.add_subcommand(
          "doctor", "Probe an oracle for its contract, and say in words what is wrong")),
      source_(command_) {
  command_->add_option("-e,--epsilon", options_.epsilon, "that a mesh is planned with");
  command_->add_option("--seed", options_.random_seed, "of the random questions")
      ->capture_default_str();
  command_->add_flag("--json", json_, "print the report as JSON, as doctor.proto has it");
  CLI::Option* const listen = command_->add_option(
      "--listen", listen_,
      "examine the oracles of workers that come here as to a server: host:port or unix:/path");
  command_->add_flag("--exit-with-parent", exit_with_parent_, "stop when the parent process ends")
      ->needs(listen);
  command_->footer(
      "An oracle of your own: --oracle-command, python3 -m stellate doctor MODULE:OBJECT, "
      "stellate::Check in C++, and in other languages what their client calls check.\n"
      "Exit status: 0 it keeps its contract, 1 it does not, 2 usage, 3 the command does not run.");
}

int DoctorCommand::Run(const std::stop_token& stop) {
  if (!listen_.empty()) return Listen(stop);
  const Expected<std::unique_ptr<Oracle>> oracle = source_.Make(stop);
  if (!oracle) return PrintError(oracle.error());
  const CheckReport report = Check(**oracle, options_);
  if (stop.stop_requested()) {
    std::cerr << "stellate: stopped before the end of the examination\n";
    return kExitNotCertified;
  }
  Print(report);
  return report.ok() ? kExitCertified : kExitNotCertified;
}

// Until it is stopped. The exit status is that of the worst oracle.
int DoctorCommand::Listen(const std::stop_token& stop) {
  const pid_t parent = getppid();
  grpc_init();                    // for good: its shutdown now and then waits for ten seconds
  std::signal(SIGPIPE, SIG_IGN);  // whoever started it need not read the reports
  std::atomic<bool> all_well = true;
  DoctorService service(options_.random_seed, [&](const CheckReport& report) {
    if (!report.ok()) all_well = false;
    Print(report);
  });
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort(listen_, grpc::InsecureServerCredentials(), &port);
  builder.SetMaxReceiveMessageSize(kLargestMessage);
  builder.RegisterService(static_cast<v1::Stellate::Service*>(&service));
  builder.RegisterService(static_cast<v1::Doctor::Service*>(&service));
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (server == nullptr) {
    return PrintError({ErrorCode::kRefused, "cannot listen on " + listen_, "INVALID_ARGUMENT"});
  }
  std::string address = listen_;
  if (address.rfind("unix:", 0) != 0) {
    address = address.substr(0, address.rfind(':') + 1) + std::to_string(port);
  }
  std::cout << "stellate doctor listening on " << address << std::endl;
  while (!stop.stop_requested() && !(exit_with_parent_ && getppid() != parent)) {
    std::this_thread::sleep_for(kLook);
  }
  server->Shutdown(std::chrono::system_clock::now());
  return all_well ? kExitCertified : kExitNotCertified;
}

void DoctorCommand::Print(const CheckReport& report) const {
  std::string text = ToText(report);
  if (json_) {
    text.clear();
    google::protobuf::util::JsonPrintOptions options;
    options.add_whitespace = true;
    options.always_print_primitive_fields = true;
    options.preserve_proto_field_names = true;
    (void)google::protobuf::util::MessageToJsonString(ToProto(report), &text, options);
  }
  std::cout << text << std::flush;
}

}  // namespace stellate::cli
