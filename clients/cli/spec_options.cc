#include "spec_options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "mesh_settings.h"
#include "shared/auto.h"

namespace stellate::cli {
namespace {

constexpr size_t kMaxLabel = 128;  // bytes that a server takes

void Add(CLI::App* to, const MeshSetting& setting, MeshOptions* options) {
  std::visit(
      [&](auto field) {
        auto& value = options->*field;
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, std::optional<bool>>) {
          // Not add_flag(value), which makes false of what nobody said.
          to->add_flag_function(
              setting.flag, [&value](std::int64_t said) { value = said > 0; }, setting.help);
        } else if constexpr (std::is_same_v<T, std::optional<Seconds>>) {
          to->add_option_function<double>(
              setting.flag, [&value](double seconds) { value = Seconds(seconds); }, setting.help);
        } else {
          CLI::Option* const option = to->add_option(setting.flag, value, setting.help);
          if constexpr (std::is_arithmetic_v<T>) option->capture_default_str();
        }
      },
      setting.field);
}

}  // namespace

SpecOptions::SpecOptions(CLI::App* command, bool serves) {
  const CLI::Option* const epsilon =
      command
          ->add_option_function<std::string>(
              "-e,--epsilon", [this](const std::string& text) { SetEpsilon(text); },
              "largest circumradius of a simplex, a length; or auto: a quarter of the reach that "
              "'stellate doctor' finds")
          ->type_name("FLOAT|auto REQUIRED");
  // CLI11 would say only that it is required.
  command->final_callback([epsilon] {
    if (epsilon->count() > 0) return;
    std::string what = automatic::kEpsilonIs;
    constexpr std::string_view kSlot = "{auto}";
    what.replace(what.find(kSlot), kSlot.size(), "--epsilon auto");
    throw CLI::RequiredError("--epsilon is required: " + what, CLI::ExitCodes::RequiredError);
  });
  for (const MeshSetting& setting : RunSettings()) Add(command, setting, &options);
  if (serves) {
    for (const MeshSetting& setting : ServingSettings()) Add(command, setting, &options);
  }
  CLI::App* const criteria = command->add_option_group("Criteria", "absent: the server's defaults");
  for (const MeshSetting& setting : CriteriaSettings()) Add(criteria, setting, &options);
  criteria
      ->add_option(
          "--shape", [this](const CLI::results_t&) { return options.good_shape = true; },
          "good, for closed manifolds of k = 3: --sliver 0.3, and dihedral angles of 18 degrees at "
          "least in place of 14, with 5 to 25 % more vertices")
      ->check(CLI::IsMember({"good"}))
      ->type_name("SHAPE")
      ->excludes("--sliver");
  command
      ->add_option(
          "--audit",
          [this](const CLI::results_t& given) {
            options.thorough_audit = given.back() == "thorough";
            return true;
          },
          "how much is asked before certifying: standard, or thorough, which is about "
          "every vertex and every simplex")
      ->check(CLI::IsMember({"standard", "thorough"}))
      ->type_name("LEVEL")
      ->default_str("standard");
}

void SpecOptions::SetEpsilon(const std::string& text) {
  if (text == "auto") {
    options.epsilon = kAuto;
    return;
  }
  double length = 0;
  if (CLI::detail::lexical_cast(text, length) && std::isfinite(length)) {
    options.epsilon = length;
    return;
  }
  throw CLI::ValidationError("--epsilon", "has to be a length or auto, and is '" + text + "'");
}

void SpecOptions::SetLabel(const std::string& text) { options.label = text.substr(0, kMaxLabel); }

}  // namespace stellate::cli
