#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "stellate/error.h"

namespace stellate::view {

// 128 random bits in hex.
std::string NewSecret();

// What shows that one knows `secret` without telling it: HMAC-SHA256 in hex of who says it, the
// address at which it is said, and the other side's nonce.
std::string Proof(std::string_view secret, std::string_view who, std::string_view host,
                  std::string_view nonce);
// In a time that does not tell where they differ.
bool Same(std::string_view a, std::string_view b);

// The secret of the process that serves pages at a port of this user. One that was killed leaves it
// behind, so that its successor at the same port is known to the pages that are open; one that ends
// well takes it away. Without a file (port 0, or nowhere to put it) it lives as long as this.
class KeptSecret {
 public:
  explicit KeptSecret(std::uint16_t port);
  ~KeptSecret();
  KeptSecret(const KeptSecret&) = delete;
  KeptSecret& operator=(const KeptSecret&) = delete;

  const std::string& value() const { return value_; }

 private:
  std::string path_, value_;
};

}  // namespace stellate::view
