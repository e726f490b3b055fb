// Calls that pile up on a connection, faster than gRPC lets go of them or beyond its bound.

#include "server/net/connection_guard.h"

#include <grpcpp/create_channel.h>

#include "tests/server/support/live_server.h"
#include "tests/server/support/loopback.h"
#include "tests/server/support/raw_http2.h"

namespace stellate::server::testing {
namespace {

constexpr int kStreams = 4;    // open at once on a connection
constexpr int kAllowed = 260;  // and 256 that were reset
constexpr int kTooMany = 3000;

class ConnectionGuardTest : public LiveServer {
 protected:
  void StartGuarded() {
    Config config;
    config.metrics_listen = "127.0.0.1:0";
    config.max_connection_streams = kStreams;
    // Nothing else ends what a stranger holds, who answers no pings, and whose calls are some 50 MB
    // of unread requests, too.
    config.hello_seconds = config.keepalive_seconds = 3600;
    config.max_unread_bytes = std::uint64_t{1} << 30;
    StartTcp(config);
  }

  // How many connections were closed, as /metrics says.
  std::string Closed() const {
    const std::string reply = GetMetrics(server_->metrics_port());
    const std::string series = "stellate_limit_refusals_total{limit=\"max-connection-streams\"} ";
    const std::size_t at = reply.find(series);
    if (at == std::string::npos) return "none";
    const std::size_t begin = at + series.size();
    return reply.substr(begin, reply.find('\n', begin) - begin);
  }

  bool MeshesWell() {
    const std::string name = CreateSphere();
    RawWorker worker(stub_.get(), name);
    return WatchToEnd(name).state() == v1::MESH_STATE_SUCCEEDED;
  }
};

// gRPC itself bounds them once the client has acknowledged the bound, which this one does not.
TEST_F(ConnectionGuardTest, CallsThatAreHeldOpenBeyondTheBoundCloseTheirConnectionAlone) {
  StartGuarded();
  ASSERT_TRUE(MeshesWell());
  for (const char* rpc : {"ServeOracle", "WatchMesh", "GetServerInfo"}) {
    RawHttp2 stranger(port());
    stranger.Call(rpc, kTooMany, /*reset=*/false);
    stranger.AwaitEnd();
  }
  EXPECT_EQ(Closed(), "3");
  EXPECT_TRUE(MeshesWell()) << "on the connection that was there before";
  stub_ = NewStub();
  EXPECT_TRUE(MeshesWell()) << "on a new one";
}

// However fast one comes after the other.
TEST_F(ConnectionGuardTest, EveryConnectionThatIsClosedIsLogged) {
  constexpr int kStrangers = 3;
  ::testing::internal::CaptureStderr();
  StartGuarded();
  for (int i = 0; i < kStrangers; ++i) {
    RawHttp2 stranger(port());
    stranger.Call("GetServerInfo", kTooMany, /*reset=*/false);
    stranger.AwaitEnd();
  }
  server_.reset();
  const std::string log = ::testing::internal::GetCapturedStderr();
  const std::string closed = "] closed ";
  int logged = 0;
  for (std::size_t at = 0; (at = log.find(closed, at)) != std::string::npos;) {
    at += closed.size();
    logged += std::stoi(log.substr(at));
  }
  EXPECT_EQ(logged, kStrangers) << log;
}

TEST_F(ConnectionGuardTest, CallsThatAreResetFewAtATimeAreLeftAlone) {
  StartGuarded();
  RawHttp2 hasty(port());
  for (const char* rpc : {"ServeOracle", "WatchMesh", "GetServerInfo"}) {
    hasty.Call(rpc, kAllowed / 4, /*reset=*/true);
    EXPECT_TRUE(hasty.IsAlive());
  }
  EXPECT_TRUE(MeshesWell());
  EXPECT_TRUE(hasty.IsAlive());
  EXPECT_EQ(Closed(), "none");
}

// Whether one of these storms is cut depends on how fast the machine is; that it harms nobody does
// not.
TEST_F(ConnectionGuardTest, StormsOfResetsHarmNobodyElse) {
  StartGuarded();
  std::thread storm([this] {
    for (const char* rpc : {"WatchMesh", "Nothing"}) {
      RawHttp2 stranger(port());
      stranger.Call(rpc, kTooMany, /*reset=*/true);
    }
  });
  EXPECT_TRUE(MeshesWell());
  storm.join();
  stub_ = NewStub();
  EXPECT_TRUE(MeshesWell());
}

// Nothing else ends those that say nothing here. An eighth of 128 may.
TEST_F(ConnectionGuardTest, WhoSaysNoHelloMakesRoomForThoseWhoDo) {
  constexpr int kSilent = 100, kMaySay = 16;
  Config config;
  config.max_connections = 128;
  config.hello_seconds = config.keepalive_seconds = 3600;
  StartTcp(config);
  ASSERT_TRUE(MeshesWell());
  const auto before = std::move(stub_);
  std::vector<int> silent;
  for (int i = 0; i < kSilent; ++i) {
    silent.push_back(ConnectTo(port()));
    const std::string half = "PRI * HTTP/2.0\r\n";
    if (i % 2 == 1) send(silent.back(), half.data(), half.size(), MSG_NOSIGNAL);
  }
  stub_ = NewStub();
  EXPECT_TRUE(MeshesWell()) << "behind all of them";
  for (int i = 0; i < kSilent - kMaySay; ++i) {
    char byte = 0;
    while (recv(silent[static_cast<std::size_t>(i)], &byte, 1, 0) > 0) {  // gRPC's settings
    }
  }
  stub_ = NewStub();
  EXPECT_TRUE(MeshesWell());
  v1::ServerInfo info;
  grpc::ClientContext context;
  EXPECT_TRUE(before->GetServerInfo(&context, {}, &info).ok()) << "who has said hello stays";
  for (const int fd : silent) close(fd);
}

TEST(Channelz, NamesTheOtherEndAsGrpcDoes) {
  const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  EXPECT_EQ(PeerOf(server), "");
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(place);
  ASSERT_EQ(bind(server, reinterpret_cast<sockaddr*>(&place), size), 0);
  ASSERT_EQ(listen(server, 1), 0);
  ASSERT_EQ(getsockname(server, reinterpret_cast<sockaddr*>(&place), &size), 0);
  const int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(connect(client, reinterpret_cast<sockaddr*>(&place), size), 0);
  EXPECT_EQ(PeerOf(client), "ipv4:127.0.0.1:" + std::to_string(ntohs(place.sin_port)));
  close(client);
  close(server);
}

}  // namespace
}  // namespace stellate::server::testing
