#include "server/base/threads.h"

#include <gtest/gtest.h>

#include "tests/server/support/no_more_threads.h"

namespace stellate::server {
namespace {

TEST(Threads, AreThereForAServer) { EXPECT_TRUE(CheckThreads(LeastThreads()).ok()); }

TEST(Threads, AStartWithoutThemIsRefusedInWords) {
  {
    const testing::NoMoreThreads none;
    const core::Status status = CheckThreads(LeastThreads());
    EXPECT_EQ(status.code, core::StatusCode::kFailedPrecondition);
    EXPECT_NE(status.message.find("have 0 more threads"), std::string::npos) << status.message;
    EXPECT_NE(status.message.find("ulimit -u"), std::string::npos) << status.message;
  }
  EXPECT_TRUE(CheckThreads(LeastThreads()).ok());
}

}  // namespace
}  // namespace stellate::server
