#include "server/convert/error_map.h"

#include <gtest/gtest.h>

#include "server/base/failure.h"
#include "tests/server/support/status_matchers.h"

namespace stellate::server {
namespace {

using core::StatusCode;
using testing::DetailsOf;
using testing::FieldIn;
using testing::ReasonIn;

TEST(ErrorMap, EachCoreCodeHasItsStatusAndReason) {
  const struct {
    StatusCode code;
    grpc::StatusCode status;
  } cases[] = {
      {StatusCode::kInvalidArgument, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kLimitExceeded, grpc::StatusCode::RESOURCE_EXHAUSTED},
      {StatusCode::kOracleShape, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleNotFinite, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleOffFlat, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleOutsideRadius, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleBadTangent, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleBadSize, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleNotIdempotent, grpc::StatusCode::INVALID_ARGUMENT},
      {StatusCode::kOracleFailed, grpc::StatusCode::ABORTED},
      {StatusCode::kFailedPrecondition, grpc::StatusCode::FAILED_PRECONDITION},
  };
  for (const auto& [code, expected] : cases) {
    const grpc::Status status = ToGrpc({code, "words"});
    EXPECT_EQ(status.error_code(), expected) << core::StatusCodeName(code);
    EXPECT_EQ(status.error_message(), "words");
    // The core's names and the protocol's are the same words.
    EXPECT_EQ(ReasonIn(status), core::StatusCodeName(code));
    EXPECT_EQ(DetailsOf(status).code(), expected);
  }
  EXPECT_TRUE(ToGrpc(core::Status::Ok()).ok());
  EXPECT_EQ(ReasonOf(StatusCode::kNoSeeds), v1::ERROR_REASON_NO_SEEDS);
}

TEST(ErrorMap, EachReasonOfAReplyHasACode) {
  for (int value = 1; value < v1::ERROR_REASON_NO_SEEDS; ++value) {
    if (!v1::ErrorReason_IsValid(value)) continue;
    const auto reason = static_cast<v1::ErrorReason>(value);
    const bool internal = v1::ErrorReason_Name(reason) == "ERROR_REASON_INTERNAL";
    EXPECT_EQ(CodeOf(reason) == grpc::StatusCode::INTERNAL, internal) << value;
  }
}

TEST(ErrorMap, NamesTheFieldThatTheStatusNames) {
  const core::Status status{StatusCode::kInvalidArgument, "it is -1", "epsilon"};
  EXPECT_EQ(FieldIn(ToGrpc(status)), "epsilon");
  EXPECT_EQ(FieldIn(ToGrpc(status, "spec.")), "spec.epsilon");
  EXPECT_EQ(FieldIn(ToGrpc(Refused({"max-vertices", "7", "mesh"}, "too many", "limits"), "spec.")),
            "spec.limits");
  EXPECT_EQ(FieldIn(ToGrpc(core::Status{StatusCode::kInvalidArgument, "epsilon is -1"}, "spec.")),
            "");
}

TEST(ErrorMap, LongMessagesFitIntoTrailers) {
  std::string long_words;
  for (int i = 0; i < 5000; ++i) long_words += "é";
  const grpc::Status status = Refusal(v1::ERROR_REASON_INVALID_ARGUMENT, "x" + long_words, "field");
  EXPECT_LT(3 * status.error_message().size() + status.error_details().size() * 4 / 3, 8000u);
  EXPECT_EQ(FieldIn(status), "field") << "cut between characters, or it would not parse";
}

TEST(ErrorMap, CutKeepsCharactersWhole) {
  EXPECT_EQ(Cut("abc", 5), "abc");
  EXPECT_EQ(Cut("abc", 2), "ab");
  EXPECT_EQ(Cut("aé", 2), "a");
  EXPECT_EQ(Cut("é", 1), "");
}

// What ends a mesh is told by the names that errors.proto promises.
TEST(ErrorMap, KnowsEachReasonThatAMeshFailsFor) {
  for (int value = 1; value <= static_cast<int>(FailureReason::kInternal); ++value) {
    const auto reason = static_cast<FailureReason>(value);
    if (reason == FailureReason::kCancelled) continue;  // ends a mesh without a failure
    v1::ErrorReason known{};
    const std::string name = std::string("ERROR_REASON_") + FailureReasonName(reason);
    EXPECT_TRUE(v1::ErrorReason_Parse(name, &known)) << name;
  }
}

}  // namespace
}  // namespace stellate::server
