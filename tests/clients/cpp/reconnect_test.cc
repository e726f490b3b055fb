// When a lost server is waited for, for how long, and who may end the wait.
#include "net/reconnect.h"

#include <grpc/grpc.h>
#include <gtest/gtest.h>

#include <limits>
#include <thread>
#include <vector>

#include "net/channel.h"
#include "shared/reconnect.h"
#include "stellate/download.h"
#include "stellate/serve.h"

namespace stellate::client {
namespace {

const grpc::Status kLost(grpc::StatusCode::UNAVAILABLE, "Socket closed");

TEST(Connect, LeavesGrpcsOwnShutdownToTheEndOfTheProcess) {
  ASSERT_TRUE(Connect({"127.0.0.1:1"}));
  EXPECT_NE(grpc_is_initialized(), 0) << "the shutdown now and then waits for ten seconds";
}

TEST(IsTransient, TellsALostServerFromOneThatRefuses) {
  using enum grpc::StatusCode;
  for (const grpc::StatusCode code : {UNAVAILABLE, CANCELLED}) {
    EXPECT_TRUE(IsTransient(grpc::Status(code, ""))) << code;
  }
  EXPECT_TRUE(IsTransient(grpc::Status(UNKNOWN, "Stream removed")));
  EXPECT_FALSE(IsTransient(grpc::Status::OK));
  for (const grpc::StatusCode code :
       {UNKNOWN, INVALID_ARGUMENT, DEADLINE_EXCEEDED, NOT_FOUND, ALREADY_EXISTS, PERMISSION_DENIED,
        UNAUTHENTICATED, RESOURCE_EXHAUSTED, FAILED_PRECONDITION, ABORTED, OUT_OF_RANGE,
        UNIMPLEMENTED, INTERNAL, DATA_LOSS}) {
    EXPECT_FALSE(IsTransient(grpc::Status(code, "no"))) << code;
  }
}

TEST(Backoff, DoublesToItsLimitAndDiffersFromClientToClient) {
  Backoff backoff(1), other(2);
  Seconds full = Backoff::kFirst;
  bool differs = false;
  for (int i = 0; i < 20; ++i) {
    const Seconds pause = backoff.Next();
    EXPECT_GT(pause, full / 2);
    EXPECT_LE(pause, full);
    differs = differs || pause != other.Next();
    full = std::min(reconnect::kPauseGrowth * full, Backoff::kLongest);
  }
  EXPECT_TRUE(differs);
  EXPECT_EQ(full, Backoff::kLongest);
  backoff.Reset();
  EXPECT_LE(backoff.Next(), Backoff::kFirst);
}

// The public headers, which are read without what is generated, repeat what all clients share.
TEST(Defaults, AreThoseOfAllClients) {
  const auto are_shared = [](const auto& options) {
    EXPECT_EQ(options.connection.reconnect, Seconds(reconnect::kGiveUp));
    EXPECT_EQ(options.connection.keepalive, Seconds(reconnect::kKeepalive));
  };
  are_shared(MeshOptions());
  are_shared(ServeOptions());
  are_shared(DownloadOptions());
}

TEST(Reconnector, TriesAgainAndTellsOfTheOutageOnce) {
  std::vector<Outage> told;
  Reconnector reconnector({Seconds(1000), {}, {}, [&](const Outage& o) { told.push_back(o); }});
  reconnector.Attempt();
  reconnector.Heard();
  EXPECT_TRUE(told.empty());
  for (int i = 1; i <= 2; ++i) {
    EXPECT_TRUE(reconnector.Again(kLost));
    reconnector.Attempt();
    EXPECT_TRUE(reconnector.reconnecting());
    ASSERT_EQ(told.size(), static_cast<size_t>(i));
    EXPECT_EQ(told.back().attempts, i);
    EXPECT_EQ(told.back().message, "Socket closed");
    EXPECT_FALSE(told.back().over);
  }
  reconnector.Heard();
  reconnector.Heard();
  ASSERT_EQ(told.size(), 3u);
  EXPECT_TRUE(told.back().over);
  EXPECT_FALSE(reconnector.reconnecting());
}

TEST(Reconnector, DoesNotWaitWhereWaitingIsOfNoUse) {
  Reconnector impatient({Seconds(0), {}, {}, {}});
  EXPECT_FALSE(impatient.Again(kLost));
  Reconnector alone({Seconds(1000), {}, [] { return true; }, {}});
  EXPECT_FALSE(alone.Again(kLost));
  Reconnector refused({Seconds(1000), {}, {}, {}});
  EXPECT_FALSE(refused.Again(grpc::Status(grpc::StatusCode::NOT_FOUND, "no such mesh")));
  EXPECT_FALSE(refused.Again(grpc::Status::OK));
  refused.Finish();
  EXPECT_FALSE(refused.Again(kLost));
}

TEST(Reconnector, GivesUpAfterItsTime) {
  int attempts = 0;
  Reconnector reconnector({Seconds(0.3), {}, {}, [&](const Outage&) { ++attempts; }});
  while (reconnector.Again(kLost)) reconnector.Attempt();
  EXPECT_GE(attempts, 1);
}

TEST(Reconnector, IsStoppedFromAnotherThreadWhileItWaits) {
  for (const bool cancel : {true, false}) {
    Reconnector* waiting = nullptr;
    std::jthread stopper;
    // Told of the outage the other thread stops it, before or during the wait.
    Reconnector reconnector(
        {Seconds(std::numeric_limits<double>::max()), {}, {}, [&](const Outage&) {
           stopper = std::jthread([&] {
             if (cancel) {
               waiting->Stop();
             } else {
               waiting->Finish();
             }
           });
         }});
    waiting = &reconnector;
    while (reconnector.Again(kLost)) reconnector.Attempt();
    EXPECT_TRUE(reconnector.stopped());
  }
}

}  // namespace
}  // namespace stellate::client
