// Requests that never become whole: what they may hold, and for how long.

#include "server/grpc_parts/unread.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/server/support/certificates.h"
#include "tests/server/support/live_server.h"
#include "tests/server/support/loopback.h"
#include "tests/server/support/raw_http2.h"

namespace stellate::server::testing {
namespace {

constexpr std::uint32_t kDeclared = 4 << 20;  // bytes of a message
constexpr std::size_t kPart = 60'000;         // of which this part comes
constexpr std::uint64_t kMost = 16 << 20;     // that all may hold

using Headers = std::vector<std::pair<std::string, std::string>>;

class UnreadTest : public LiveServer {
 protected:
  void StartBounded(double request_seconds, const std::string& token_file = "") {
    Config config;
    config.token_file = token_file;
    config.metrics_listen = "127.0.0.1:0";
    config.max_unread_bytes = kMost;
    config.request_seconds = request_seconds;
    config.keepalive_seconds = config.hello_seconds = 3600;  // nothing else closes a connection
    StartTcp(config);
  }

  // How many connections were closed for a setting, as /metrics says.
  int Closed(const std::string& setting) const {
    const std::string reply = GetMetrics(server_->metrics_port());
    const std::string series = "stellate_limit_refusals_total{limit=\"" + setting + "\"} ";
    const std::size_t at = reply.find(series);
    return at == std::string::npos ? 0 : std::stoi(reply.substr(at + series.size()));
  }

  bool MeshesWell() {
    const std::string name = CreateSphere();
    RawWorker worker(stub_.get(), name);
    return WatchToEnd(name).state() == v1::MESH_STATE_SUCCEEDED;
  }

  // A request as large as a message may be; the name is no mesh's.
  grpc::StatusCode GetWithLargeName() {
    grpc::ClientContext context;
    v1::GetMeshRequest request;
    request.set_name(std::string(4'000'000, 'x'));
    v1::Mesh mesh;
    return stub_->GetMesh(&context, request, &mesh).error_code();
  }
};

TEST_F(UnreadTest, IsCounted) { EXPECT_TRUE(CountsUnread()); }

TEST_F(UnreadTest, ConnectionsThatHoldTooMuchTogetherAreClosed) {
  StartBounded(3600);
  ASSERT_TRUE(MeshesWell());
  for (const char* rpc : {"CreateMesh", "WatchMesh", "ServeOracle"}) {
    const int before = Closed("max-unread-bytes");
    std::vector<std::unique_ptr<RawHttp2>> strangers;
    for (std::uint64_t held = 0; held < 2 * kMost; held += kPart) {
      strangers.push_back(std::make_unique<RawHttp2>(port()));
      strangers.back()->Request(rpc, kDeclared, kPart);
    }
    while (Closed("max-unread-bytes") == before) std::this_thread::yield();
    EXPECT_TRUE(MeshesWell()) << "on the connection that was there before";
    // Whoever answers has been read; what was read since the first went may be too much again.
    const auto held = [&strangers] {
      const auto alive = [](const auto& stranger) { return stranger->IsAlive(); };
      return static_cast<std::uint64_t>(std::count_if(strangers.begin(), strangers.end(), alive)) *
             kPart;
    };
    SCOPED_TRACE(rpc);
    while (held() > kMost) std::this_thread::yield();
  }
  EXPECT_EQ(Closed("request-seconds"), 0);
}

// What strangers hold is not taken from those who have a token.
TEST_F(UnreadTest, OwnersHaveAnAccountOfTheirOwn) {
  const ScratchDirectory directory;
  const std::string token = "alice-0123456789abcdef";
  WriteFile(directory / "tokens", "alice " + token + "\n");
  const Headers headers = {{"authorization", "Bearer " + token}};
  constexpr int kCalls = static_cast<int>(kMost / 2 / kCallBytes);  // both together are too many
  StartBounded(3600, directory / "tokens");
  RawHttp2 stranger(port()), owner(port());
  stranger.Call("/grpc.health.v1.Health/Check", kCalls - 20, /*reset=*/false);
  owner.Call("GetMesh", kCalls - 20, /*reset=*/false, headers);
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(stranger.IsAlive());
    ASSERT_TRUE(owner.IsAlive());
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(Closed("max-unread-bytes"), 0);
  stranger.Call("/grpc.health.v1.Health/Check", kCalls, /*reset=*/false);
  stranger.AwaitEnd();
  EXPECT_EQ(Closed("max-unread-bytes"), 1);
  EXPECT_TRUE(owner.IsAlive());
  owner.Call("GetMesh", kCalls, /*reset=*/false, headers);
  owner.AwaitEnd();
  EXPECT_EQ(Closed("max-unread-bytes"), 2);
}

// Nobody has a large question for a service that is open to everybody.
TEST_F(UnreadTest, LargeRequestsToOpenServicesCloseTheirConnection) {
  StartBounded(3600);
  for (const char* path : {"/grpc.health.v1.Health/Check",
                           "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"}) {
    RawHttp2 curious(port()), greedy(port());
    curious.Request(path, kSmallBytes, kSmallBytes / 2);
    EXPECT_TRUE(curious.IsAlive());
    greedy.Request(path, kDeclared, kPart);
    greedy.AwaitEnd();
  }
  EXPECT_EQ(Closed("request-seconds"), 0);
}

// Whole messages, and those of calls that are over, are not held any more.
TEST_F(UnreadTest, WhatWasTakenOrGivenUpDoesNotCount) {
  StartBounded(3600);
  for (std::uint64_t sent = 0; sent < 2 * kMost; sent += 4'000'000) {
    EXPECT_EQ(GetWithLargeName(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  for (std::uint64_t sent = 0; sent < 2 * kMost; sent += kPart) {
    RawHttp2 stranger(port());
    ASSERT_TRUE(stranger.Request(sent % 2 == 0 ? "Nothing" : "CreateMesh", kDeclared, kPart));
    ASSERT_TRUE(stranger.IsAlive());  // so that it was read
  }
  EXPECT_EQ(Closed("max-unread-bytes"), 0);
  EXPECT_TRUE(MeshesWell());
}

TEST_F(UnreadTest, ARequestThatDoesNotBecomeWholeClosesItsConnection) {
  StartBounded(0.3);
  const std::string waiting = CreateSphere();
  for (const char* rpc : {"CreateMesh", "DownloadMesh", "ServeOracle"}) {
    RawHttp2 silent(port()), slow(port());
    silent.Request(rpc, kDeclared, 0);
    slow.Request(rpc, kDeclared, kPart);
    silent.AwaitEnd();
    slow.AwaitEnd();
  }
  EXPECT_EQ(Closed("request-seconds"), 6);
  // Connections that have nothing to say live on, as do calls that wait for the server.
  EXPECT_EQ(Get(waiting).state(), v1::MESH_STATE_WAITING);
  RawWorker worker(stub_.get(), waiting);
  EXPECT_EQ(WatchToEnd(waiting).state(), v1::MESH_STATE_SUCCEEDED);
  EXPECT_EQ(Closed("request-seconds"), 6);
}

// The time begins with the request, however long nobody said anything before.
TEST_F(UnreadTest, AConnectionThatWasSilentHasAllTheTimeForItsRequest) {
  constexpr auto kTime = std::chrono::seconds(2);
  StartBounded(static_cast<double>(kTime.count()));
  RawHttp2 client(port());
  ASSERT_TRUE(client.IsAlive());
  std::this_thread::sleep_for(2 * kTime);
  ASSERT_TRUE(client.Request("CreateMesh", kDeclared, kPart));
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(client.IsAlive());
    std::this_thread::sleep_for(kTime / 100);
  }
  EXPECT_EQ(Closed("request-seconds"), 0);
}

}  // namespace
}  // namespace stellate::server::testing
