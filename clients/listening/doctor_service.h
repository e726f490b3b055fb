#pragma once

#include <grpcpp/grpcpp.h>

#include <cstdint>
#include <functional>
#include <list>
#include <mutex>
#include <string>

#include "stellate/doctor.h"
#include "stellate/v1/doctor.grpc.pb.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

v1::CheckReport ToProto(const CheckReport& report);

// Examines the oracles of workers that come as to a server (doctor.proto). Any thread may call.
class DoctorService final : public v1::Stellate::Service, public v1::Doctor::Service {
 public:
  // `on_report` receives the report of every examination, one at a time.
  DoctorService(std::uint64_t random_seed, std::function<void(const CheckReport&)> on_report);

  grpc::Status CreateMesh(grpc::ServerContext* context, const v1::CreateMeshRequest* request,
                          v1::Mesh* mesh) override;
  grpc::Status ServeOracle(
      grpc::ServerContext* context,
      grpc::ServerReaderWriter<v1::ServeOracleResponse, v1::ServeOracleRequest>* stream) override;
  grpc::Status GetMesh(grpc::ServerContext* context, const v1::GetMeshRequest* request,
                       v1::Mesh* mesh) override;
  grpc::Status DeleteMesh(grpc::ServerContext* context, const v1::DeleteMeshRequest* request,
                          google::protobuf::Empty* nothing) override;
  grpc::Status GetServerInfo(grpc::ServerContext* context, const v1::GetServerInfoRequest* request,
                             v1::ServerInfo* info) override;
  grpc::Status GetCheckReport(grpc::ServerContext* context,
                              const v1::GetCheckReportRequest* request,
                              v1::CheckReport* report) override;

 private:
  struct Patient {
    v1::Mesh mesh;
    v1::CheckReport report;  // when the mesh is over
  };
  // Null if there is none. Under the lock.
  Patient* Find(const std::string& name);
  // Whether the oracle is to be examined now; its specification.
  grpc::Status Admit(const std::string& name, v1::MeshSpec* spec);
  void Discharge(const std::string& name, const CheckReport& report, bool lost);

  const std::uint64_t random_seed_;
  const std::function<void(const CheckReport&)> on_report_;
  std::mutex mutex_;
  std::list<Patient> patients_;  // the newest
  std::uint64_t count_ = 0;
};

}  // namespace stellate::client
