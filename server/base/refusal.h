#pragma once

#include <cstdint>
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

// An answer that broke a rule: its chunk's lease, and the wrong row, from 0, if it is a single one.
struct AnswerPlace {
  std::uint64_t lease = 0;
  std::optional<std::int64_t> row;
};

// A status, with the limit if one was reached, and the answer if one was wrong. Ok converts as
// core::Status does.
struct Refused : core::Status {
  Refused(core::Status status)  // NOLINT: every status is one
      : core::Status(std::move(status)) {}
  Refused(LimitHit hit, std::string words, std::string of_field = "")
      : core::Status{core::StatusCode::kLimitExceeded, std::move(words), std::move(of_field)},
        limit(std::move(hit)) {}

  Refused(AnswerPlace at, core::Status status) : core::Status(std::move(status)), answer(at) {}

  std::optional<LimitHit> limit;
  std::optional<AnswerPlace> answer;
};

template <typename T>
using Allowed = tl::expected<T, Refused>;

}  // namespace stellate::server
