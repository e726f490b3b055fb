#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace stellate {

// How this library fails. A function whose work can fail returns Expected<T>. A constructor of a
// ready oracle throws std::invalid_argument, since its arguments are the program's own; a call of
// an oracle throws OracleError or what the user's function threw, and a mesh that it ends rethrows
// that.

// The kind of an error.
enum class ErrorCode {
  kRefused,       // the request is invalid or asks for too much: correct it and try again
  kOracleFailed,  // the oracle answered wrongly, or not at all
  kServerFailed,  // no server was found, none answers, or the connection was lost
  kFileFailed,    // a file cannot be written, or its format cannot hold the mesh
  kStopped,       // the caller's stop_token ended the call
};

// What went wrong: the code and the reason for programs, the message for people.
struct Error {
  ErrorCode code = ErrorCode::kServerFailed;
  std::string reason;   // the server's stable name for it, e.g. "ORACLE_NOT_FINITE"; may be empty
  std::string message;  // what was wrong, where, and what to do
};

// A value, or the Error that says why there is none.
//
//   const stellate::Expected<stellate::Mesh> mesh = stellate::MeshManifold(oracle, options);
//   if (!mesh) std::cerr << mesh.error().message << '\n';
template <typename T>
using Expected = tl::expected<T, Error>;

// What a function of that type returns where it has no value.
inline tl::unexpected<Error> Fail(ErrorCode code, std::string message, std::string reason = "") {
  return tl::unexpected<Error>(Error{code, std::move(reason), std::move(message)});
}

}  // namespace stellate
