#pragma once

#include <optional>
#include <string>
#include <utility>

#include "core/status.h"

namespace stellate::server {

// A limit that was reached: the setting, its value, and of what ("server", "owner", "mesh").
struct LimitHit {
  std::string setting;  // "max-meshes"
  std::string value;
  std::string scope;
};

// A status, and the limit where one was reached. Ok converts as core::Status does.
struct Refused : core::Status {
  Refused(core::Status status)  // NOLINT: every status is one
      : core::Status(std::move(status)) {}
  Refused(LimitHit hit, std::string words, std::string of_field = "")
      : core::Status{core::StatusCode::kLimitExceeded, std::move(words), std::move(of_field)},
        limit(std::move(hit)) {}

  std::optional<LimitHit> limit;
};

template <typename T>
using Allowed = tl::expected<T, Refused>;

}  // namespace stellate::server
