// What a stranger may try before anybody asks who it is, and what others may read afterwards.

#include <grpcpp/generic/generic_stub.h>

#include <filesystem>
#include <future>

#include "server/net/health_check.h"
#include "tests/server/support/certificates.h"
#include "tests/server/support/live_server.h"
#include "tests/server/support/loopback.h"
#include "tests/server/support/raw_http2.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;

constexpr char kToken[] = "alice-0123456789abcdef";
constexpr char kReflection[] = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";

class LiveStrangersTest : public LiveServer {
 protected:
  // A new client's call, until the server has room for it.
  bool IsServed() {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    context.set_deadline(std::chrono::system_clock::now() + 60s);
    v1::ServerInfo info;
    return NewStub()->GetServerInfo(&context, {}, &info).ok();
  }

  // What the server says first, waited for.
  static bool IsHungUpOn(int fd) {
    char byte = 0;
    const ssize_t got = recv(fd, &byte, 1, 0);
    return got == 0 || (got < 0 && errno == ECONNRESET);
  }
};

// A megabyte may stand for a gigabyte, and gRPC unpacks before it measures.
TEST_F(LiveStrangersTest, PackedMessagesAreRefusedUnread) {
  Start();
  for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    grpc::ClientContext unary, stream;
    unary.set_compression_algorithm(algorithm);
    stream.set_compression_algorithm(algorithm);
    v1::GetMeshRequest get;
    get.set_name(std::string(1 << 16, 'x'));
    v1::Mesh mesh;
    EXPECT_EQ(stub_->GetMesh(&unary, get, &mesh).error_code(), StatusCode::UNIMPLEMENTED);
    const auto serving = stub_->ServeOracle(&stream);
    v1::ServeOracleRequest request;
    request.mutable_hello()->set_mesh(get.name());
    serving->Write(request);
    EXPECT_EQ(serving->Finish().error_code(), StatusCode::UNIMPLEMENTED);
  }
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

TEST_F(LiveStrangersTest, ConnectionsBeyondTheLimitAreClosedUntilOthersGo) {
  Config config;
  config.max_connections = 3;
  StartTcp(config);
  std::vector<int> held;
  for (int i = 0; i < 3; ++i) held.push_back(ConnectTo(port()));
  for (int i = 0; i < 20; ++i) {
    const int more = ConnectTo(port());
    EXPECT_TRUE(IsHungUpOn(more));
    close(more);
  }
  for (const int fd : held) close(fd);
  EXPECT_TRUE(IsServed());
}

TEST_F(LiveStrangersTest, ConnectionsThatSayNothingAreClosed) {
  Config config;
  config.hello_seconds = 0.2;
  StartTcp(config);
  const int silent = ConnectTo(port());  // and says nothing
  char bytes[4096];
  // What the server says first, and then the end.
  while (recv(silent, bytes, sizeof(bytes), 0) > 0) continue;
  close(silent);
  EXPECT_TRUE(IsServed());
}

// Of which it has sent next to nothing.
TEST_F(LiveStrangersTest, CallersAreRefusedBeforeTheirRequestIsRead) {
  const ScratchDirectory directory;
  WriteFile(directory / "tokens", std::string("alice ") + kToken + "\n");
  Config config;
  config.token_file = directory / "tokens";
  config.request_seconds = 5;  // else it would wait for the request
  StartTcp(config);
  for (const char* rpc : {"CreateMesh", "GetMesh", "ListMeshes", "CancelMesh", "DeleteMesh",
                          "GetServerInfo", "ServeOracle", "WatchMesh", "DownloadMesh", "Examine"}) {
    RawHttp2 stranger(port());
    stranger.Request(rpc, 4 << 20, 1);
    EXPECT_NE(stranger.AwaitAnswer().find("no token came"), std::string::npos) << rpc;
    EXPECT_TRUE(stranger.IsAlive());
  }
  RawHttp2 stranger(port());
  stranger.Request("Nothing", 4 << 20, 1);
  EXPECT_NE(stranger.AwaitAnswer().find("no such method"), std::string::npos);
}

TEST_F(LiveStrangersTest, CallsWithoutARequestAreToldSo) {
  Start();
  grpc::GenericStub stub(
      grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  for (const char* rpc : {"GetMesh", "WatchMesh", "DownloadMesh", "Examine"}) {
    for (const char* request : {"", "\xff\xff"}) {
      grpc::ClientContext context;
      grpc::CompletionQueue queue;
      const auto call =
          stub.PrepareCall(&context, std::string("/stellate.v1.Stellate/") + rpc, &queue);
      const auto await = [&queue] {
        void* tag = nullptr;
        bool ok = false;
        EXPECT_TRUE(queue.Next(&tag, &ok));
      };
      call->StartCall(nullptr);
      await();
      const grpc::Slice slice(request);
      if (slice.size() > 0) {
        call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
        await();
      }
      call->WritesDone(nullptr);
      await();
      grpc::Status status;
      call->Finish(&status, nullptr);
      await();
      EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << rpc << status.error_message();
      EXPECT_NE(status.error_message().find("no request came"), std::string::npos);
    }
  }
}

// Reflection runs on threads, of which there are few.
TEST_F(LiveStrangersTest, ReflectionStreamsHoldUpNobody) {
  Start();
  grpc::GenericStub stub(
      grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials()));
  class Caller final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
   public:
    explicit Caller(grpc::GenericStub* stub) {
      stub->PrepareBidiStreamingCall(&context_, kReflection, grpc::StubOptions(), this);
      StartCall();
    }
    ~Caller() override {
      context_.TryCancel();
      done_.get_future().wait();
    }
    void OnDone(const grpc::Status&) override { done_.set_value(); }

   private:
    grpc::ClientContext context_;
    std::promise<void> done_;
  };
  std::vector<std::unique_ptr<Caller>> callers;
  for (int i = 0; i < 300; ++i) callers.push_back(std::make_unique<Caller>(&stub));
  EXPECT_EQ(CheckHealth(server_->address(), 60s), "");
  const std::string name = CreateSphere();
  RawWorker worker(stub_.get(), name);
  EXPECT_EQ(WatchToEnd(name).state(), v1::MESH_STATE_SUCCEEDED);
}

// Names open meshes and lead nowhere else.
TEST_F(LiveStrangersTest, NamesOfMeshesAreNoPaths) {
  const ScratchDirectory directory;
  Config config;
  config.data_dir = directory / "journal";
  Start(config);
  const std::string good = CreateSphere();
  for (std::string name :
       {std::string("meshes/../../../../etc/passwd"), std::string("../journal.sqlite"),
        good + "/..", good + std::string(1, '\0'), "meshes//" + good.substr(7),
        std::string("meshes/%00"), "MESHES/" + good.substr(7), good + "\n"}) {
    grpc::ClientContext contexts[2];
    v1::GetMeshRequest get;
    get.set_name(name);
    v1::DeleteMeshRequest remove;
    remove.set_name(name);
    v1::Mesh mesh;
    google::protobuf::Empty empty;
    EXPECT_EQ(stub_->GetMesh(&contexts[0], get, &mesh).error_code(), StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(stub_->DeleteMesh(&contexts[1], remove, &empty).error_code(),
              StatusCode::INVALID_ARGUMENT);
  }
  EXPECT_EQ(Get(good).state(), v1::MESH_STATE_WAITING);
}

// The journal holds owners, by name; nothing that lets anybody in.
TEST_F(LiveStrangersTest, RecordsHoldNoTokens) {
  const ScratchDirectory directory;
  WriteFile(directory / "tokens", std::string("alice ") + kToken + "\n");
  Config config;
  config.token_file = directory / "tokens";
  config.data_dir = directory / "journal";
  Start(config);
  grpc::ClientContext context;
  context.AddMetadata("authorization", std::string("Bearer ") + kToken);
  v1::CreateMeshRequest request;
  *request.mutable_spec() = SpecOfSphere();
  v1::Mesh mesh;
  ASSERT_TRUE(stub_->CreateMesh(&context, request, &mesh).ok());
  server_->Stop(0s);  // writes what there is to write
  std::string recorded;
  for (const auto& file : std::filesystem::directory_iterator(config.data_dir)) {
    recorded += ReadFile(file.path());
    EXPECT_EQ(file.status().permissions() & std::filesystem::perms::others_all,
              std::filesystem::perms::none)
        << file.path();
  }
  EXPECT_NE(recorded.find("alice"), std::string::npos) << "the mesh was recorded";
  EXPECT_NE(recorded.find(mesh.name()), std::string::npos);
  EXPECT_EQ(recorded.find("0123456789abcdef"), std::string::npos);
}

}  // namespace
}  // namespace stellate::server::testing
