#pragma once

#include <grpcpp/support/server_callback.h>

#include "server/rpc/call.h"
#include "server/rpc/incoming.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::server {

// One function for each rpc, each in its own file. None of them waits for anything.
grpc::ServerBidiReactor<Incoming<v1::CreateMeshRequest>, v1::Mesh>* CreateMesh(
    ServerState& state, grpc::CallbackServerContext* context);
grpc::Status GetMesh(const Call& call, const v1::GetMeshRequest& request, v1::Mesh* mesh);
grpc::Status ListMeshes(const Call& call, const v1::ListMeshesRequest& request,
                        v1::ListMeshesResponse* response);
grpc::Status CancelMesh(const Call& call, const v1::CancelMeshRequest& request, v1::Mesh* mesh);
grpc::Status DeleteMesh(const Call& call, const v1::DeleteMeshRequest& request,
                        google::protobuf::Empty* empty);
grpc::Status GetServerInfo(const Call& call, const v1::GetServerInfoRequest& request,
                           v1::ServerInfo* info);
grpc::ServerBidiReactor<Incoming<v1::ServeOracleRequest>, v1::ServeOracleResponse>* ServeOracle(
    ServerState& state, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<Incoming<v1::ExamineRequest>, v1::ExamineResponse>* Examine(
    ServerState& state, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<Incoming<v1::WatchMeshRequest>, v1::WatchMeshResponse>* WatchMesh(
    ServerState& state, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<Incoming<v1::DownloadMeshRequest>, v1::DownloadMeshResponse>* DownloadMesh(
    ServerState& state, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<Incoming<v1::PointsChunk>, v1::ReconstructReply>* Reconstruct(
    ServerState& state, grpc::CallbackServerContext* context);

}  // namespace stellate::server
