#include "run/check.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "run/check_report.h"
#include "run/rank.h"
#include "run/worker.h"
#include "shared/equations.h"
#include "stellate/client.h"
#include "stellate/v1/stellate.grpc.pb.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate {
namespace client {
namespace {

constexpr Eigen::Index kShownEntries = 6;

std::string Shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string Shown(const Eigen::VectorXd& point) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < std::min(point.size(), kShownEntries); ++i) {
    char entry[32];
    std::snprintf(entry, sizeof entry, "%s%.6g", i > 0 ? ", " : "", point[i]);
    text += entry;
  }
  return text + (point.size() > kShownEntries ? ", ...]" : "]");
}

// What `failure` is for an examination, as servers put it.
Finding FindingOf(const std::string& during, const std::exception_ptr& failure,
                  const std::string& advice) {
  Finding finding{Severity::kError, "RAISED", during + ": ", advice};
  try {
    std::rethrow_exception(failure);
  } catch (const OracleError& error) {
    if (error.reason() == "ORACLE_SHAPE") finding.code = "WRONG_SHAPE";
    if (error.reason() == "ORACLE_NOT_FINITE") finding.code = "NOT_FINITE";
    if (error.reason() == "ORACLE_PRECISION") finding.code = "INEXACT";
    finding.message += error.what();
  } catch (const std::exception& error) {
    finding.message += error.what();
  } catch (...) {
    finding.message += "an exception that is no std::exception";
  }
  return finding;
}

// What the oracle says of itself; or what is wrong with it, before anything is asked.
tl::expected<v1::MeshSpec, Finding> Declare(Oracle& oracle, const CheckOptions& options) {
  MeshOptions declared;
  declared.epsilon = options.epsilon.value_or(0);
  declared.random_seed = options.random_seed;
  try {
    Expected<v1::MeshSpec> spec = ToSpec(oracle, declared);
    if (spec) return std::move(*spec);
    return tl::unexpected(Finding{Severity::kError, "WRONG_SHAPE", spec.error().message, ""});
  } catch (...) {
    return tl::unexpected(FindingOf("the oracle failed to say what it is", std::current_exception(),
                                    "Let it say where M is and what it can before any query."));
  }
}

// Answers until the examination is over. Returns how the stream broke off, if it did.
std::optional<Error> Serve(const Host& host, v1::Stellate::Stub& stub, Oracle& oracle,
                           const std::string& name, const std::stop_token& stop) {
  Worker worker(stub, oracle, name, "check", {Seconds(0), host.channel, host.IsHopeless(), {}});
  const std::stop_callback leave(stop, [&worker] { worker.Stop(); });
  worker.Run();
  return worker.error();
}

Expected<CheckReport> Examine(const Host& host, Oracle& oracle, const v1::MeshSpec& spec,
                              const std::stop_token& stop) {
  const auto stub = v1::Stellate::NewStub(host.channel);
  grpc::ClientContext context;
  const std::stop_callback cancel(stop, [&context] { context.TryCancel(); });
  v1::ExamineRequest request;
  *request.mutable_spec() = spec;
  const auto stream = stub->Examine(&context, request);
  v1::ExamineResponse response;
  std::optional<Error> failure;
  std::optional<CheckReport> report;
  while (stream->Read(&response)) {
    if (response.has_mesh()) failure = Serve(host, *stub, oracle, response.mesh().name(), stop);
    if (response.has_report()) report = ReadCheckReport(response.report());
  }
  const grpc::Status status = stream->Finish();
  if (stop.stop_requested()) {
    return Fail(ErrorCode::kStopped, "stopped before the end of the examination");
  }
  if (report) return std::move(*report);
  if (failure) return tl::unexpected(*failure);  // there was no examination
  if (status.ok()) return tl::unexpected(BrokenProtocol("an examination without a report"));
  return tl::unexpected(FromStatus(status));
}

// Without repeatable answers there is no M to follow equations along.
bool HasManifold(const CheckReport& report) {
  return report.samples > 0 && report.Find("NOT_DETERMINISTIC") == nullptr &&
         report.Find("NOT_IDEMPOTENT") == nullptr;
}

std::string Filled(std::string text, const std::string& slot, const std::string& value) {
  return text.replace(text.find(slot), slot.size(), value);
}

// What only the client can look at.
std::optional<Finding> ExamineEquations(Oracle& oracle, std::uint64_t random_seed) {
  try {
    const std::optional<Singular> singular = FindSingular(oracle, random_seed);
    if (!singular) return std::nullopt;
    const auto& [message, advice] = equations::kSingular;
    return Finding{Severity::kError,
                   "SINGULAR",
                   Filled(Filled(message, "{query}", Shown(singular->place)), "{ratio}",
                          Shown(singular->ratio)),
                   advice,
                   singular->place,
                   {{"ratio", singular->ratio}}};
  } catch (...) {
    return FindingOf("the oracle failed where its equations were looked at",
                     std::current_exception(),
                     "Give the gradients of all equations at every point of M.");
  }
}

}  // namespace

Expected<CheckReport> CheckOn(const Host& host, Oracle& oracle, const CheckOptions& options) {
  CheckReport report;
  if (const auto spec = Declare(oracle, options)) {
    Expected<CheckReport> examined = Examine(host, oracle, *spec, options.stop);
    if (!examined) return examined;
    report = std::move(*examined);
  } else {
    Add(spec.error(), &report);
  }
  if (HasManifold(report)) {
    if (auto fault = ExamineEquations(oracle, options.random_seed)) Add(std::move(*fault), &report);
  }
  return report;
}

Expected<ChosenEpsilon> ChooseEpsilonOn(const Host& host, Oracle& oracle,
                                        const CheckOptions& options) {
  const Expected<CheckReport> report = CheckOn(host, oracle, options);
  if (!report) return tl::unexpected(report.error());
  if (report->epsilon) return ChosenEpsilon{*report->epsilon, report->epsilon_reason};
  return Fail(ErrorCode::kOracleFailed, report->epsilon_reason,
              report->ok() ? "ORACLE_NO_REACH" : "ORACLE_BREAKS_CONTRACT");
}

}  // namespace client

Expected<CheckReport> Check(Oracle& oracle, const CheckOptions& options) {
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  return client::CheckOn(*host, oracle, options);
}

Expected<ChosenEpsilon> ChooseEpsilon(Oracle& oracle, const CheckOptions& options) {
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  return client::ChooseEpsilonOn(*host, oracle, options);
}

}  // namespace stellate
