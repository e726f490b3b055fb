#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace stellate::core {

// The reason of a refusal. One table in server/ maps these to gRPC codes.
enum class StatusCode {
  kOk = 0,
  kInvalidArgument,      // a specification that makes no sense: fix it, then try again
  kLimitExceeded,        // a specification beyond what this build can do (k too large)
  kNoSeeds,              // no seed has a closest point on the manifold
  kOracleShape,          // answers of the wrong count or size
  kOracleNotFinite,      // NaN or infinity in an answer
  kOracleOffFlat,        // an intersection that is not in the flat asked for
  kOracleOutsideRadius,  // an intersection farther than the radius asked for
  kOracleBadTangent,     // a tangent basis that is not orthonormal
  kOracleBadConormal,    // a conormal that is no unit tangent vector, or walls that are tangential
  kOracleBadSize,        // a local size that is not positive, or another for the same point
  kOracleNotIdempotent,  // closest_point moves a point that it returned itself
  kOracleFailed,         // the oracle reported a failure of its own, or vanished
  kFailedPrecondition,   // a call out of order
  kCancelled,            // the caller interrupted it
};

// A refusal: the code for programs, the message for people. The message names the offending
// value, where it was found, the rule that it broke and what to do.
//
//   const Status status = Validate(spec);
//   if (!status.ok()) std::cerr << status.field << ": " << status.message << '\n';
struct Status {
  StatusCode code = StatusCode::kOk;
  std::string message;
  std::string field{};  // the wrong field of a Specification, "criteria.candidates", or empty

  bool ok() const { return code == StatusCode::kOk; }
  static Status Ok() { return {}; }
};

// Stable upper-case name of a code, e.g. "ORACLE_NOT_FINITE". Programs may compare it.
const char* StatusCodeName(StatusCode code);

// A value, or the Status that says why there is none.
//
//   const Expected<int> half = Half(7);
//   if (!half) std::cerr << StatusCodeName(half.error().code) << ": " << half.error().message;
template <typename T>
using Expected = tl::expected<T, Status>;

// What a function of that type returns where it has no value. `field`: as in Status.
//
//   Expected<int> Half(int n) {
//     if (n % 2 != 0) return Refuse(StatusCode::kInvalidArgument, Message(n, " is odd"), "n");
//     return n / 2;
//   }
inline tl::unexpected<Status> Refuse(StatusCode code, std::string message, std::string field = "") {
  return tl::unexpected<Status>(Status{code, std::move(message), std::move(field)});
}

}  // namespace stellate::core
