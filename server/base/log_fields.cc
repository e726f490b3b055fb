#include "server/base/log_fields.h"

#include <algorithm>

#include "server/base/log.h"

namespace stellate::server {

LogFields& LogFields::AddText(std::string_view name, const std::string& value) {
  const std::string quoted = JsonString(value);
  const bool plain = !value.empty() && std::all_of(value.begin(), value.end(), [](unsigned char c) {
    return c > ' ' && c != '"' && c != '\\' && c != '=' && c != 0x7f;
  });
  return Append(name, plain ? value : quoted, quoted);
}

LogFields& LogFields::Append(std::string_view name, const std::string& text,
                             const std::string& json) {
  text_ += core::Message(" ", name, "=", text);
  json_ += core::Message(",\"", name, "\":", json);
  return *this;
}

}  // namespace stellate::server
