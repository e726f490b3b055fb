#include "server/auth/tokens.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <sys/stat.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/base/message.h"
#include "server/base/file_stamp.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;
using core::StatusCode;

constexpr std::size_t kMaxOwnerBytes = 64;
constexpr std::size_t kMinTokenBytes = 16;
constexpr std::size_t kMaxTokenBytes = 512;
constexpr std::string_view kAdministrator = "administrator";
constexpr std::string_view kWeight = "weight=";
constexpr unsigned kMaxWeight = 1000;
constexpr std::string_view kBlank = " \t\r";
constexpr std::size_t kMaxFileBytes = std::size_t{16} << 20;

bool IsOwnerCharacter(unsigned char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-' || c == '@';
}

// What a header can carry and a line of words can hold.
bool IsTokenCharacter(unsigned char c) { return c > ' ' && c < 0x7f; }

tl::unexpected<core::Status> BadLine(std::size_t number, const std::string& rule) {
  return core::Refuse(StatusCode::kInvalidArgument, Message("line ", number, " ", rule));
}

std::vector<std::string_view> WordsOf(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find_first_of(kBlank), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(std::min(line.find_first_not_of(kBlank, end), line.size()));
  }
  return words;
}

std::optional<unsigned> ReadWeight(std::string_view text) {
  unsigned weight = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), weight);
  const bool is_number = error == std::errc() && end == text.data() + text.size();
  if (!is_number || weight < 1 || weight > kMaxWeight) return std::nullopt;
  return weight;
}

core::Expected<TokenTable> Read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file.good() && !file.eof()) {
    return core::Refuse(StatusCode::kInvalidArgument, "it cannot be read");
  }
  if (text.size() > kMaxFileBytes) {
    return core::Refuse(StatusCode::kInvalidArgument,
                        Message("it has ", text.size(), " bytes but may have ", kMaxFileBytes));
  }
  auto table = TokenTable::Parse(text);
  OPENSSL_cleanse(text.data(), text.size());
  return table;
}

void WarnIfOpen(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) == 0 && (info.st_mode & 0007) != 0) {
    Log(LogLevel::kWarning, {},
        Message("--token-file ", path, " can be read by every user of this machine: chmod 600"));
  }
}

}  // namespace

TokenDigest Digest(std::string_view token) {
  TokenDigest digest{};
  unsigned int size = 0;
  if (EVP_Digest(token.data(), token.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1 ||
      size != digest.size()) {
    throw std::runtime_error("SHA-256 is not available");
  }
  return digest;
}

core::Expected<TokenTable> TokenTable::Parse(std::string_view text) {
  TokenTable table;
  std::size_t number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    line.remove_prefix(std::min(line.find_first_not_of(kBlank), line.size()));
    line = line.substr(0, line.find_last_not_of(kBlank) + 1);
    if (line.empty() || line.front() == '#') continue;

    auto words = WordsOf(line);
    if (words.size() < 2) return BadLine(number, "must be an owner and a token");
    const std::string owner(words[0]);
    const std::string_view token = words[1];
    words.erase(words.begin(), words.begin() + 2);
    if (owner.size() > kMaxOwnerBytes || !std::all_of(owner.begin(), owner.end(), IsOwnerCharacter))
      return BadLine(number, Message("must begin with an owner of 1 to ", kMaxOwnerBytes,
                                     " letters, digits, '.', '_', '-' or '@'"));
    const auto word = std::find(words.begin(), words.end(), kAdministrator);
    const bool administrator = word != words.end();
    if (administrator) words.erase(word);
    std::optional<unsigned> weight;
    if (words.size() == 1 && words[0].starts_with(kWeight)) {
      weight = ReadWeight(words[0].substr(kWeight.size()));
      if (!weight) {
        return BadLine(
            number, Message("must have behind \"weight=\" a whole number from 1 to ", kMaxWeight));
      }
      words.clear();
    }
    if (!words.empty() || token.size() < kMinTokenBytes || token.size() > kMaxTokenBytes ||
        !std::all_of(token.begin(), token.end(), IsTokenCharacter)) {
      return BadLine(number,
                     Message("must end with a token of ", kMinTokenBytes, " to ", kMaxTokenBytes,
                             " visible ASCII characters without blanks, or "
                             "with such a one and the word ",
                             kAdministrator, ", ", kWeight, "N, or both"));
    }
    if (weight && !table.weights_.emplace(owner, *weight).second &&
        table.weights_.at(owner) != *weight) {
      return BadLine(number, "gives its owner another weight than an earlier line");
    }
    Entry entry{Digest(token), {owner, administrator}};
    if (table.HolderOf(entry.digest)) return BadLine(number, "repeats the token of another line");
    table.entries_.push_back(std::move(entry));
  }
  if (table.entries_.empty()) {
    return core::Refuse(StatusCode::kInvalidArgument, "it holds no line \"owner token\"");
  }
  return table;
}

std::optional<TokenHolder> TokenTable::HolderOf(const TokenDigest& digest) const {
  const Entry* found = nullptr;
  for (const Entry& entry : entries_) {
    const bool same = CRYPTO_memcmp(entry.digest.data(), digest.data(), digest.size()) == 0;
    found = same ? &entry : found;
  }
  if (found == nullptr) return std::nullopt;
  return found->holder;
}

unsigned TokenTable::WeightOf(const std::string& owner) const {
  const auto it = weights_.find(owner);
  return it == weights_.end() ? 1 : it->second;
}

core::Expected<std::unique_ptr<TokenFile>> TokenFile::Open(const std::string& path) {
  std::unique_ptr<TokenFile> file(new TokenFile(path));
  file->stamp_ = FileStamp(path);  // before reading: a change in between is found by Reload
  auto table = Read(path);
  if (!table) {
    return core::Refuse(StatusCode::kInvalidArgument,
                        Message("--token-file is ", path, " but ", table.error().message));
  }
  file->table_ = std::make_shared<const TokenTable>(std::move(*table));
  WarnIfOpen(path);
  return file;
}

std::shared_ptr<const TokenTable> TokenFile::Table() const {
  const std::lock_guard lock(mutex_);
  return table_;
}

std::optional<TokenHolder> TokenFile::HolderOf(const TokenDigest& digest) const {
  return Table()->HolderOf(digest);
}

unsigned TokenFile::WeightOf(const std::string& owner) const { return Table()->WeightOf(owner); }

void TokenFile::Reload(bool force) {
  std::string stamp = FileStamp(path_);
  {
    const std::lock_guard lock(mutex_);
    if (stamp == stamp_ && !force) return;
    stamp_ = std::move(stamp);
  }
  auto table = Read(path_);
  if (!table) {
    Log(LogLevel::kError, {},
        Message("--token-file ", path_, " changed but ", table.error().message,
                ": the tokens read before stay in force"));
    return;
  }
  WarnIfOpen(path_);
  Log(LogLevel::kInfo, {}, Message("--token-file ", path_, " read: ", table->size(), " tokens"));
  const std::lock_guard lock(mutex_);
  table_ = std::make_shared<const TokenTable>(std::move(*table));
}

}  // namespace stellate::server
