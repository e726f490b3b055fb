#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "stellate/client.h"

namespace stellate::cli {

// A member of MeshOptions that an option of `stellate mesh` sets.
using MeshField =
    std::variant<double MeshOptions::*, int MeshOptions::*, std::uint64_t MeshOptions::*,
                 std::optional<double> MeshOptions::*, std::optional<std::uint32_t> MeshOptions::*,
                 std::optional<std::uint64_t> MeshOptions::*, std::optional<bool> MeshOptions::*,
                 std::optional<Seconds> MeshOptions::*>;

struct MeshSetting {
  const char* flag;  // as CLI11 takes it
  const char* name;  // in messages of servers and of this client
  MeshField field;
  const char* help;
};

// What `stellate mesh --help` lists, in this order; the second are for who answers the questions.
std::span<const MeshSetting> RunSettings();
std::span<const MeshSetting> ServingSettings();
std::span<const MeshSetting> CriteriaSettings();

// A message with the flags in place of the names that they have in the protocol.
std::string InFlags(std::string_view message);

}  // namespace stellate::cli
