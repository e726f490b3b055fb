#include "server/config/flags.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdio>
#include <iostream>
#include <string>
#include <system_error>
#include <type_traits>

#include "core/base/message.h"
#include "server/base/version.h"
#include "server/config/settings.h"

namespace stellate::server {
namespace {

constexpr int kExitUsage = 2;

// A choice is given by name.
template <typename T>
CLI::Option* AddChoice(CLI::App* app, const Setting& setting, T* value, const char* current,
                       bool (*read)(const std::string&, T*)) {
  return app
      ->add_option_function<std::string>(
          setting.flag,
          [setting, value, read](const std::string& text) {
            if (read(text, value)) return;
            throw CLI::ValidationError(setting.flag,
                                       "\"" + text + "\" is none of its choices: " + setting.help);
          },
          setting.help)
      ->default_str(current);
}

// What is wrong with a number, in place of CLI11's words, which name no range, and none that help.
// It would also read -3 into a number without sign. Empty: nothing, but for the range.
template <typename T>
std::string ComplaintOf(const Setting& setting, const std::string& text) {
  T value{};
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value);
  if (read.ec == std::errc() && read.ptr == end) return "";
  return core::Message("is \"", text, "\" but must be a ",
                       std::is_integral_v<T> ? "whole number" : "number", " from ",
                       static_cast<T>(setting.least), " to ", static_cast<T>(setting.most));
}

void AddSetting(CLI::App* app, const Setting& setting, Config* config) {
  CLI::Option* const option = std::visit(
      [&](auto field) {
        auto& value = config->*field;
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, bool>) {
          return app->add_flag(setting.flag, value, setting.help);
        } else if constexpr (std::is_same_v<T, LogLevel>) {
          return AddChoice(app, setting, &value, LogLevelName(value), ReadLogLevel);
        } else if constexpr (std::is_same_v<T, LogFormat>) {
          return AddChoice(app, setting, &value, LogFormatName(value), ReadLogFormat);
        } else if constexpr (std::is_arithmetic_v<T>) {
          return app->add_option(setting.flag, value, setting.help)
              ->check([setting](const std::string& text) { return ComplaintOf<T>(setting, text); });
        } else {
          return app->add_option(setting.flag, value, setting.help);
        }
      },
      setting.field);
  if (*setting.group != '\0') option->group(setting.group);
}

// The command line, which writes into `flags` what it reads.
struct CommandLine {
  explicit CommandLine(Flags* flags);
  void Read(int argc, const char* const* argv, Flags* flags);

  CLI::App app{"stellated: meshes smooth manifolds for clients that serve their oracles."};
  bool print_config = false;
};

CommandLine::CommandLine(Flags* into) {
  Flags& flags = *into;
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", VersionLine());
  app.set_config("--config", "",
                 "File of lines \"KEY = VALUE\", the keys being these flags without dashes. Read "
                 "again after SIGHUP: --print-config says which settings change then");
  app.allow_config_extras(CLI::config_extras_mode::error);

  const auto add_command = [this](const char* flag, auto* value, const char* help) {
    using T = std::decay_t<decltype(*value)>;
    if constexpr (std::is_same_v<T, bool>) {
      app.add_flag(flag, *value, help)->configurable(false);
    } else {
      app.add_option(flag, *value, help)->configurable(false);
    }
  };
  add_command("--print-config", &print_config,
              "Print a configuration file with every setting as it stands, and exit");
  add_command("--health-check", &flags.health_check,
              "Ask the server at --listen whether it serves; exit 0 if so, else 1");
  add_command("--health-service", &flags.health_service,
              "What to ask it about: stellate.v1.Stellate, or \"alive\", which holds while it "
              "drains too; default: the server as a whole");
  add_command("--health-cert", &flags.health_certificate,
              "PEM file with the certificate that it shows, where --tls-client-ca would not take "
              "--tls-cert");
  add_command("--health-key", &flags.health_key, "PEM file with its private key");
  add_command("--exit-with-parent", &flags.exit_with_parent,
              "Stop when the process that started this one is gone");
  add_command("--verify-data-dir", &flags.verify_data_dir,
              "Read every record in --data-dir, change nothing, say what there is, and exit; 0 if "
              "it is sound, else 1");
  add_command("--salvage", &flags.salvage,
              "Where the record in --data-dir is damaged, begin a new one with all that can be "
              "read, keep the damaged files beside it, say what is lost, and exit; 0 if that "
              "succeeds, else 1");
  app.add_option("--copy-meshes", flags.copy_meshes,
                 "Copy all meshes from one data directory or database (a URL, or a file that has "
                 "it) to another, read them back, say what was done, and exit; 0 if all are there, "
                 "else 1. No server may run on either. Broken off, it goes on with the same words")
      ->type_name("FROM TO")
      ->expected(2)
      ->configurable(false);
  for (const Setting& setting : Settings()) AddSetting(&app, setting, &flags.config);
}

void CommandLine::Read(int argc, const char* const* argv, Flags* flags) {
  app.parse(argc, argv);
  if (app.get_config_ptr()->count() > 0)
    flags->config_file = app.get_config_ptr()->as<std::string>();
}

// Its words are about INI files; what it could not place is their last part.
std::string ComplaintOf(const CLI::ConfigError& error) {
  std::string words = error.what();
  if (words.find("not allowed") != std::string::npos) return words;
  const std::string key = words.substr(words.rfind(' ') + 1);
  if (key.ends_with(".++")) {  // as CLI11 writes its beginning
    return "there is a section [" + key.substr(0, key.find('.')) +
           "]: settings stand in the file without sections";
  }
  return "there is no setting \"" + key + "\": --print-config prints those that there are";
}

}  // namespace

ParsedFlags ParseFlags(int argc, const char* const* argv) {
  ParsedFlags parsed;
  CommandLine line(&parsed.flags);
  try {
    line.Read(argc, argv, &parsed.flags);
    if (line.print_config) {
      std::fputs(ToConfigFile(parsed.flags.config).c_str(), stdout);
      parsed.exit_status = 0;
    }
  } catch (const CLI::ConfigError& error) {
    std::fprintf(stderr, "stellated: --config: %s\n", ComplaintOf(error).c_str());
    parsed.exit_status = kExitUsage;
  } catch (const CLI::ParseError& error) {
    parsed.exit_status = line.app.exit(error) == 0 ? 0 : kExitUsage;
  }
  return parsed;
}

core::Expected<Config> ReadSettingsAgain(int argc, const char* const* argv) {
  Flags flags;
  CommandLine line(&flags);
  std::string complaint;
  try {
    line.Read(argc, argv, &flags);
    return flags.config;
  } catch (const CLI::ConfigError& error) {
    complaint = ComplaintOf(error);
  } catch (const CLI::Error& error) {
    complaint = error.what();
  }
  return core::Refuse(core::StatusCode::kInvalidArgument, std::move(complaint));
}

}  // namespace stellate::server
