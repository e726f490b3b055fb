// Header blocks without end, which gRPC 1.51 would read for ever (CVE-2023-33953), and 1.56.2 for
// long.

#include "server/grpc_parts/header_bound.h"

#include <chrono>
#include <thread>

#include "tests/server/support/live_server.h"
#include "tests/server/support/raw_http2.h"

namespace stellate::server::testing {
namespace {

constexpr char kRpc[] = "GetServerInfo";
// Far above the bound, and too little to occupy a server that copies it again and again.
constexpr std::size_t kEndless = 1 << 20;
constexpr std::size_t kFrame = 16 << 10;  // the largest that a client may send unasked

// A header "x", whose value has 2^30 bytes, of which none have come.
const std::string& EndlessHeader() {
  static const std::string header("\0\1x\x7f\x81\xff\xff\xff\x03", 9);
  return header;
}

class HeaderBoundTest : public LiveServer {
 protected:
  void SetUp() override {
    Config config;
    config.metrics_listen = "127.0.0.1:0";
    config.keepalive_seconds = config.hello_seconds = 3600;  // nothing else closes a connection
    StartTcp(config);
  }

  bool MeshesWell() {
    const std::string name = CreateSphere();
    RawWorker worker(stub_.get(), name);
    return WatchToEnd(name).state() == v1::MESH_STATE_SUCCEEDED;
  }

  // Begins a block and adds the same to it again and again. True: that made the server hang up.
  bool IsCut(const std::string& begin, const std::string& more) {
    const std::uint64_t before = EndlessHeaderBlocks();
    RawHttp2 stranger(port());
    Send(&stranger, begin, more);
    EXPECT_FALSE(stranger.IsAlive());  // as this is no place for a sign of life, it ends anyway
    return EndlessHeaderBlocks() == before + 1;
  }

  void Send(RawHttp2* stranger, const std::string& begin, const std::string& more) {
    bool open = stranger->Headers(begin, kFrame, /*end=*/false);
    for (std::size_t sent = 0; open && sent < kEndless; sent += more.size() + 9) {
      open = stranger->MoreHeaders(more);
    }
  }
};

TEST_F(HeaderBoundTest, IsInForce) { EXPECT_TRUE(HeaderBlocksEnd()); }

TEST_F(HeaderBoundTest, AHeaderWithoutEndClosesItsConnectionAlone) {
  EXPECT_TRUE(IsCut(EndlessHeader(), std::string(kFrame, 'y')));
  EXPECT_TRUE(IsCut(RawHttp2::HeadersOf(kRpc) + EndlessHeader(), std::string(1000, 'y')));
  EXPECT_TRUE(MeshesWell()) << "on the connection that was there before";
}

TEST_F(HeaderBoundTest, ABlockOfSmallHeadersWithoutEndClosesItsConnection) {
  const std::string header("\0\1a\1b", 5);
  std::string many;
  for (int i = 0; i < 100; ++i) many += header;
  EXPECT_TRUE(IsCut(header, header)) << "one to a frame";
  EXPECT_TRUE(IsCut(header, many));
  EXPECT_TRUE(IsCut(header, std::string(1, '\x82'))) << "of one byte each, :method GET";
  EXPECT_TRUE(MeshesWell());
}

TEST_F(HeaderBoundTest, FramesAndNumbersWithoutEndCloseTheirConnections) {
  EXPECT_TRUE(IsCut(std::string(1, '\0'), "")) << "empty frames";
  RawHttp2 stranger(port());
  Send(&stranger, std::string("\0\x7f", 2), std::string(kFrame, '\x80'));  // a length of zeros
  stranger.AwaitEnd();  // by gRPC 1.56.2 itself, which takes sixteen of them
  EXPECT_TRUE(MeshesWell());
}

// What a client that keeps to gRPC's own bound may send, in as many frames as it likes to.
TEST_F(HeaderBoundTest, HeadersWithinTheBoundAreTaken) {
  RawHttp2 client(port());
  const std::string large = RawHttp2::HeadersOf(kRpc, {{"x", std::string(7000, 'y')}});
  // One block after another on a connection: they are not added up.
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(client.Headers(large, i % 2 == 0 ? kFrame : 1000, /*end=*/true));
  }
  EXPECT_TRUE(client.IsAlive());
}

TEST_F(HeaderBoundTest, MoreMetadataThanGrpcAllowsIsRefusedFromItsFirstCall) {
  RawHttp2 client(port());  // which acknowledges no bound
  client.Headers(RawHttp2::HeadersOf(kRpc, {{"x", std::string(9000, 'y')}}), kFrame, /*end=*/true);
  const std::string answer = client.AwaitAnswer();  // of gRPC 1.51: the end of the connection
  EXPECT_TRUE(answer.empty() || answer.find("grpc-status\x01"
                                            "8") != std::string::npos)
      << answer;
  EXPECT_TRUE(MeshesWell());
}

// Blocks that were left unfinished are forgotten with their connections, whose memory is used
// again.
TEST_F(HeaderBoundTest, BlocksThatWereBrokenOffAreForgotten) {
  const std::string half = RawHttp2::HeadersOf(kRpc, {{"x", std::string(7000, 'y')}});
  for (int i = 0; i < 100; ++i) {
    RawHttp2 stranger(port());
    ASSERT_TRUE(stranger.Headers(half, kFrame, /*end=*/false)) << i;
  }
  RawHttp2 client(port());
  ASSERT_TRUE(client.Headers(half, kFrame, /*end=*/true));
  EXPECT_TRUE(client.IsAlive());
  EXPECT_TRUE(MeshesWell());
}

TEST_F(HeaderBoundTest, ClosedConnectionsAreCounted) {
  const auto counted = [this] {
    return GetMetrics(server_->metrics_port()).find("{limit=\"header-bytes\"} 2\n") !=
           std::string::npos;
  };
  EXPECT_FALSE(counted());
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(IsCut(EndlessHeader(), std::string(kFrame, 'y')));
  while (!counted()) std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

TEST(HeaderBound, KnowsWhichVersionsLackIt) {
  for (const char* version :
       {"1.30.2", "1.51.1", "1.53.1", "1.54.2", "1.55.1", "1.56.1", "1.56.0-pre1"}) {
    EXPECT_TRUE(LacksHeaderBound(version)) << version;
  }
  for (const char* version :
       {"1.53.2", "1.54.3", "1.55.2", "1.56.2", "1.57.0", "1.65.5", "2.0.0"}) {
    EXPECT_FALSE(LacksHeaderBound(version)) << version;
  }
}

}  // namespace
}  // namespace stellate::server::testing
