#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace stellate::server {

// SHA-256 of bytes that come in pieces. Value() may be called between them.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Add(const void* data, std::size_t bytes);
  std::string Value() const;  // 32 bytes, of all that was added

 private:
  struct Context;
  const std::unique_ptr<Context> context_;
};

// In hexadecimal digits.
std::string Hexadecimal(const std::string& bytes);

}  // namespace stellate::server
