#include "server/base/failure.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace stellate::server {
namespace {

using core::StatusCode;

TEST(FailureReason, EachHasANameOfItsOwnByWhichItIsFound) {
  std::set<std::string> names;
  for (int value = 0; value <= static_cast<int>(FailureReason::kInternal); ++value) {
    const auto reason = static_cast<FailureReason>(value);
    EXPECT_TRUE(names.insert(FailureReasonName(reason)).second) << value;
    EXPECT_EQ(FailureReasonOf(FailureReasonName(reason)), reason) << value;
  }
}

TEST(FailureReason, NothingElseIsAName) {
  EXPECT_EQ(FailureReasonOf("NO_WORKERS"), std::nullopt);
  EXPECT_EQ(FailureReasonOf(""), FailureReason::kNone);
}

TEST(FailureReason, OfTheCoreHasItsName) {
  for (int value = 1; value <= static_cast<int>(StatusCode::kCancelled); ++value) {
    const auto code = static_cast<StatusCode>(value);
    const MeshFailure failure = ToMeshFailure({code, "words"});
    EXPECT_STREQ(FailureReasonName(failure.reason), core::StatusCodeName(code));
    EXPECT_EQ(failure.message, "words");
  }
  EXPECT_EQ(ToMeshFailure(core::Status::Ok()).reason, FailureReason::kNone);
}

}  // namespace
}  // namespace stellate::server
