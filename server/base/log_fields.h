#pragma once

#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include "core/base/message.h"

namespace stellate::server {

// What a line of the log says in numbers and names, for programs that read it: each field has a
// name, which is a plain word and none of time, level, message, mesh, round.
class LogFields {
 public:
  template <typename T>
  LogFields& Add(std::string_view name, const T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      return Append(name, value ? "true" : "false", value ? "true" : "false");
    } else if constexpr (std::is_arithmetic_v<T>) {
      const std::string digits = core::Message(value);
      return Append(name, digits, std::isfinite(static_cast<double>(value)) ? digits : "null");
    } else {
      return AddText(name, std::string(value));
    }
  }

  const std::string& text() const { return text_; }  // " name=value name="two words""
  const std::string& json() const { return json_; }  // ,"name":value,"name":"two words"

 private:
  LogFields& AddText(std::string_view name, const std::string& value);
  LogFields& Append(std::string_view name, const std::string& text, const std::string& json);

  std::string text_, json_;
};

}  // namespace stellate::server
