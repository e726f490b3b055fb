#pragma once

#include <string>
#include <variant>
#include <vector>

#include "server/config/config.h"

namespace stellate::server {

// One setting: a flag of the command line, and a key of the configuration file under the same name
// without the dashes.
struct Setting {
  using Field =
      std::variant<std::string Config::*, bool Config::*, int Config::*, std::uint64_t Config::*,
                   double Config::*, LogLevel Config::*, LogFormat Config::*>;
  const char* group;  // of --help; empty: the first one
  const char* flag;   // "--max-meshes"
  Field field;
  const char* help;
  double least = 0, most = 0;  // of a number
  bool live = false;           // may change while the server runs; see TakeOver

  std::string Key() const { return flag + 2; }
};

// Every one, in the order of --help. A new setting is a member of Config and a row of this table.
const std::vector<Setting>& Settings();

// kInvalidArgument, with the flag, its value and the range, if a number is out of range.
core::Status CheckRanges(const Config& config);

// A configuration file with every setting, as --config reads it.
std::string ToConfigFile(const Config& config);

// Takes over from `next` what may change while a server runs.
struct Changes {
  std::vector<std::string> taken;          // "max-meshes = 8"
  std::vector<std::string> at_next_start;  // keys that differ, and hold from then on
};
Changes TakeOver(const Config& next, Config* config);

// Names of the choices, and back. nullptr or false: no such choice.
const char* LogLevelName(LogLevel level);
const char* LogFormatName(LogFormat format);
bool ReadLogLevel(const std::string& name, LogLevel* level);
bool ReadLogFormat(const std::string& name, LogFormat* format);

}  // namespace stellate::server
