#include "doctor_service.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "run/asked_oracle.h"
#include "run/epsilon.h"

namespace stellate::client {
namespace {

constexpr size_t kMostPatients = 64;
constexpr size_t kMostPatientBytes = size_t{16} << 20;  // of all: seeds may be many
constexpr std::uint32_t kMostDimensions = 100'000;

grpc::Status NotFound(const std::string& name) {
  return {grpc::StatusCode::NOT_FOUND, "there is no oracle " + name + " under examination"};
}

v1::Severity ToProto(Severity severity) {
  switch (severity) {
    case Severity::kError:
      return v1::SEVERITY_ERROR;
    case Severity::kWarning:
      return v1::SEVERITY_WARNING;
    case Severity::kNote:
      break;
  }
  return v1::SEVERITY_NOTE;
}

}  // namespace

v1::CheckReport ToProto(const CheckReport& report) {
  v1::CheckReport message;
  message.set_ok(report.ok());
  for (const Finding& found : report.findings) {
    v1::Finding& finding = *message.add_findings();
    finding.set_severity(ToProto(found.severity));
    finding.set_code(found.code);
    finding.set_message(found.message);
    finding.set_advice(found.advice);
  }
  message.set_text(ToText(report));
  message.set_samples(report.samples);
  message.set_queries(report.queries);
  if (report.reach) message.set_reach(*report.reach);
  if (report.pieces) message.set_pieces(static_cast<std::uint32_t>(*report.pieces));
  for (const auto& [batch, rate] : report.rates) {
    v1::BatchRate& measured = *message.add_rates();
    measured.set_batch(static_cast<std::uint32_t>(batch));
    measured.set_queries_per_second(rate);
  }
  message.set_best_batch(static_cast<std::uint32_t>(report.best_batch));
  if (const Expected<ChosenEpsilon> chosen = ChooseEpsilon(report)) {
    message.set_epsilon(chosen->epsilon);
    message.set_epsilon_reason(chosen->reason);
  } else {
    message.mutable_no_epsilon()->set_reason(chosen.error().reason);
    message.mutable_no_epsilon()->set_message(chosen.error().message);
  }
  return message;
}

DoctorService::DoctorService(std::uint64_t random_seed,
                             std::function<void(const CheckReport&)> on_report)
    : random_seed_(random_seed), on_report_(std::move(on_report)) {}

DoctorService::Patient* DoctorService::Find(const std::string& name) {
  const auto found = std::find_if(patients_.begin(), patients_.end(),
                                  [&name](const Patient& p) { return p.mesh.name() == name; });
  return found == patients_.end() ? nullptr : &*found;
}

grpc::Status DoctorService::CreateMesh(grpc::ServerContext*, const v1::CreateMeshRequest* request,
                                       v1::Mesh* mesh) {
  if (request->spec().ambient_dimension() > kMostDimensions) {
    return {grpc::StatusCode::INVALID_ARGUMENT,
            "ambient_dimension is " + std::to_string(request->spec().ambient_dimension()) +
                "; the doctor goes up to " + std::to_string(kMostDimensions)};
  }
  const std::lock_guard lock(mutex_);
  size_t bytes = request->spec().ByteSizeLong();
  for (const Patient& patient : patients_) bytes += patient.mesh.ByteSizeLong();
  while (!patients_.empty() && (patients_.size() >= kMostPatients || bytes > kMostPatientBytes)) {
    bytes -= patients_.front().mesh.ByteSizeLong();
    patients_.pop_front();
  }
  v1::Mesh& made = patients_.emplace_back().mesh;
  made.set_name("meshes/oracle-" + std::to_string(++count_));
  *made.mutable_spec() = request->spec();
  made.set_state(v1::MESH_STATE_WAITING);
  *mesh = made;
  return grpc::Status::OK;
}

grpc::Status DoctorService::Admit(const std::string& name, v1::MeshSpec* spec) {
  const std::lock_guard lock(mutex_);
  Patient* const patient = Find(name);
  if (patient == nullptr) return NotFound(name);
  if (patient->mesh.state() != v1::MESH_STATE_WAITING) {
    return {grpc::StatusCode::FAILED_PRECONDITION, "one worker is enough for an examination"};
  }
  patient->mesh.set_state(v1::MESH_STATE_RUNNING);
  *spec = patient->mesh.spec();
  return grpc::Status::OK;
}

grpc::Status DoctorService::ServeOracle(
    grpc::ServerContext*,
    grpc::ServerReaderWriter<v1::ServeOracleResponse, v1::ServeOracleRequest>* stream) {
  v1::ServeOracleRequest request;
  if (!stream->Read(&request) || !request.has_hello()) {
    return {grpc::StatusCode::INVALID_ARGUMENT, "the first message has to be Hello"};
  }
  const std::string name = request.hello().mesh();
  v1::MeshSpec spec;
  if (grpc::Status refused = Admit(name, &spec); !refused.ok()) return refused;
  v1::ServeOracleResponse response;
  response.mutable_welcome()->set_dimension(spec.dimension());
  response.mutable_welcome()->set_ambient_dimension(spec.ambient_dimension());
  *response.mutable_welcome()->mutable_oracle() = spec.oracle();
  response.mutable_welcome()->set_walls(spec.walls());
  stream->Write(response);

  AskedOracle oracle(*stream, spec, request.hello().max_chunk_queries());
  CheckOptions options;
  options.random_seed = random_seed_;
  if (spec.epsilon() > 0) options.epsilon = spec.epsilon();
  Discharge(name, Check(oracle, options), oracle.lost());
  if (oracle.lost()) return {grpc::StatusCode::ABORTED, "the oracle failed: see the report"};
  response.mutable_over()->set_state(v1::MeshState_Name(v1::MESH_STATE_SUCCEEDED));
  stream->Write(response);
  while (stream->Read(&request)) {
  }
  return grpc::Status::OK;
}

void DoctorService::Discharge(const std::string& name, const CheckReport& report, bool lost) {
  const std::lock_guard lock(mutex_);
  on_report_(report);
  Patient* const patient = Find(name);
  if (patient == nullptr) return;
  patient->report = ToProto(report);
  patient->mesh.set_state(lost ? v1::MESH_STATE_FAILED : v1::MESH_STATE_SUCCEEDED);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  patient->mesh.mutable_end_time()->set_seconds(
      std::chrono::duration_cast<std::chrono::seconds>(now).count());
}

grpc::Status DoctorService::GetMesh(grpc::ServerContext*, const v1::GetMeshRequest* request,
                                    v1::Mesh* mesh) {
  const std::lock_guard lock(mutex_);
  const Patient* const patient = Find(request->name());
  if (patient == nullptr) return NotFound(request->name());
  *mesh = patient->mesh;
  return grpc::Status::OK;
}

grpc::Status DoctorService::DeleteMesh(grpc::ServerContext*, const v1::DeleteMeshRequest* request,
                                       google::protobuf::Empty*) {
  const std::lock_guard lock(mutex_);
  const auto erased =
      std::erase_if(patients_, [&](const Patient& p) { return p.mesh.name() == request->name(); });
  return erased > 0 ? grpc::Status::OK : NotFound(request->name());
}

grpc::Status DoctorService::GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                                          v1::ServerInfo* info) {
  info->set_version("doctor");
  info->add_protocols("stellate.v1");
  return grpc::Status::OK;
}

grpc::Status DoctorService::GetCheckReport(grpc::ServerContext*,
                                           const v1::GetCheckReportRequest* request,
                                           v1::CheckReport* report) {
  const std::lock_guard lock(mutex_);
  const Patient* const patient = Find(request->name());
  if (patient == nullptr) return NotFound(request->name());
  if (!patient->mesh.has_end_time()) {
    return {grpc::StatusCode::FAILED_PRECONDITION,
            "the examination of " + request->name() + " is not over"};
  }
  *report = patient->report;
  return grpc::Status::OK;
}

}  // namespace stellate::client
