#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"

namespace stellate::server {

using TokenDigest = std::array<unsigned char, 32>;  // SHA-256

// The holder of a token.
struct TokenHolder {
  std::string owner;
  bool administrator = false;  // may see and end the meshes of all owners
  bool operator==(const TokenHolder&) const = default;
};

// Who a bearer token speaks for. Tokens themselves are forgotten once read: digests are kept, so
// that neither a log nor a core dump gives one away.
class TokenTable {
 public:
  // Lines "owner token", with the word "administrator" or a weight, "weight=4", or both behind;
  // blank lines and lines that start with '#' are skipped. An owner may have several tokens, and
  // has one weight, which one of the lines says. kInvalidArgument names the line, never what it
  // holds.
  static core::Expected<TokenTable> Parse(std::string_view text);

  // Looks at every entry, whatever it finds: the time taken says nothing about the tokens.
  std::optional<TokenHolder> HolderOf(const TokenDigest& digest) const;
  // 1 where no line says another.
  unsigned WeightOf(const std::string& owner) const;
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    TokenDigest digest;
    TokenHolder holder;
  };
  std::vector<Entry> entries_;
  std::map<std::string, unsigned> weights_;
};

TokenDigest Digest(std::string_view token);

// A token file, read again when it changes. Any thread.
class TokenFile {
 public:
  static core::Expected<std::unique_ptr<TokenFile>> Open(const std::string& path);

  std::optional<TokenHolder> HolderOf(const TokenDigest& digest) const;
  unsigned WeightOf(const std::string& owner) const;
  // Reads the file again if it is another than before, or in any case where `force`. One that
  // cannot be read, or is wrong, changes nothing and is logged once.
  void Reload(bool force = false);

 private:
  explicit TokenFile(std::string path) : path_(std::move(path)) {}

  std::shared_ptr<const TokenTable> Table() const;

  const std::string path_;
  mutable std::mutex mutex_;
  std::string stamp_;  // what the file system said of the version that was read
  std::shared_ptr<const TokenTable> table_;
};

}  // namespace stellate::server
