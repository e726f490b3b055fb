#pragma once

#include <string>
#include <utility>

#include "core/specification.h"
#include "core/status.h"

namespace stellate::core {

// What Validate says of a field. `message`: the value, the rule, the cure.
inline Status Invalid(std::string field, std::string message) {
  return {StatusCode::kInvalidArgument, std::move(message), std::move(field)};
}
inline Status TooLarge(std::string field, std::string message) {
  return {StatusCode::kLimitExceeded, std::move(message), std::move(field)};
}

// False for NaN too.
inline bool IsLength(double value) { return value >= kMinLength && value <= kMaxLength; }

}  // namespace stellate::core
