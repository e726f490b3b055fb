#pragma once

#include <string>

namespace stellate::server {

// Who "allows 2048 connections", in messages: the setting's flag, where the program has one.
inline std::string WhoAllows(const char* setting, bool has_flags) {
  return has_flags ? std::string("--") + setting : "this program";
}

}  // namespace stellate::server
