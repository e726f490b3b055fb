#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace stellate::client {

// A JSON object as it is written. Keys are ours and need no escaping.
class JsonObject {
 public:
  void Raw(const char* key, const std::string& value) {
    text_ += (text_.empty() ? "{\"" : ", \"") + std::string(key) + "\": " + value;
  }
  void Add(const char* key, std::uint64_t value) { Raw(key, std::to_string(value)); }
  void Add(const char* key, bool value) { Raw(key, value ? "true" : "false"); }
  void Add(const char* key, double value) { Raw(key, Number(value)); }
  void Add(const char* key, const std::string& value) { Raw(key, Quoted(value)); }
  std::string Take() { return text_.empty() ? "{}" : text_ + "}"; }

  // JSON knows no infinity and no NaN.
  static std::string Number(double value) {
    if (!std::isfinite(value)) return "null";
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
  }
  static std::string Quoted(const std::string& value) {
    std::string text = "\"";
    for (const char c : value) {
      if (c == '"' || c == '\\') {
        text += '\\';
        text += c;
      } else if (static_cast<unsigned char>(c) < 0x20) {
        char escape[8];
        std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(c));
        text += escape;
      } else {
        text += c;
      }
    }
    return text + "\"";
  }

 private:
  std::string text_;
};

// Values that are JSON each.
inline std::string JsonList(const std::vector<std::string>& values) {
  std::string text;
  for (const std::string& value : values) text += (text.empty() ? "[" : ", ") + value;
  return text.empty() ? "[]" : text + "]";
}

}  // namespace stellate::client
