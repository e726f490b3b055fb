#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "secret.h"

namespace stellate::view {

// The secrets by which pages are known. One thread alone.
class Keys {
 public:
  explicit Keys(std::uint16_t port) : kept_(port) {}

  const std::string& secret() const { return kept_.value(); }
  // Known for one proof.
  std::string NewForOnce() { return once_.emplace_back(NewSecret()); }

  // Which secret this proof shows, spending it if it is one for once; none: a stranger.
  std::optional<std::string> Knows(std::string_view proof, std::string_view host,
                                   std::string_view nonce) {
    if (Same(proof, Proof(secret(), "page", host, nonce))) return secret();
    for (auto it = once_.begin(); it != once_.end(); ++it) {
      if (!Same(proof, Proof(*it, "page", host, nonce))) continue;
      std::string known = std::move(*it);
      once_.erase(it);
      return known;
    }
    return std::nullopt;
  }

 private:
  KeptSecret kept_;
  std::vector<std::string> once_;
};

}  // namespace stellate::view
