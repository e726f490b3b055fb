#include "secret.h"

#include <fcntl.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <system_error>

namespace stellate::view {
namespace {

constexpr size_t kDigits = 32;

std::string Hex(const unsigned char* bytes, size_t count) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string text;
  for (size_t i = 0; i < count; ++i) {
    text += kHex[bytes[i] >> 4];
    text += kHex[bytes[i] & 15];
  }
  return text;
}

// Of this user alone. Empty: there is none.
std::string StateFolder() {
  if (const char* const runtime = std::getenv("XDG_RUNTIME_DIR"); runtime && *runtime)
    return runtime;
  if (const char* const state = std::getenv("XDG_STATE_HOME"); state && *state)
    return std::string(state) + "/stellate";
  if (const char* const home = std::getenv("HOME"); home && *home)
    return std::string(home) + "/.local/state/stellate";
  return "";
}

// Empty unless it is a whole secret that nobody else could read or put there.
std::string ReadOwn(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (file < 0) return "";
  std::string text(kDigits + 1, '\0');
  struct stat facts {};
  const bool ours = fstat(file, &facts) == 0 && S_ISREG(facts.st_mode) &&
                    facts.st_uid == getuid() && (facts.st_mode & 077) == 0;
  const ssize_t count = ours ? read(file, text.data(), text.size()) : 0;
  close(file);
  if (count != static_cast<ssize_t>(kDigits)) return "";
  text.resize(kDigits);
  return text.find_first_not_of("0123456789abcdef") == std::string::npos ? text : "";
}

bool WriteOwn(const std::string& path, const std::string& text) {
  unlink(path.c_str());
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (file < 0) return false;
  const bool whole = write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  close(file);
  return whole;
}

}  // namespace

std::string NewSecret() {
  std::array<unsigned char, kDigits / 2> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1)
    throw std::runtime_error("the system gives no random numbers");
  return Hex(bytes.data(), bytes.size());
}

std::string Proof(std::string_view secret, std::string_view who, std::string_view host,
                  std::string_view nonce) {
  std::string text;
  for (const std::string_view part :
       {who, std::string_view(" "), host, std::string_view(" "), nonce})
    text += part;
  std::array<unsigned char, EVP_MAX_MD_SIZE> code{};
  unsigned int size = 0;
  HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
       reinterpret_cast<const unsigned char*>(text.data()), text.size(), code.data(), &size);
  return Hex(code.data(), size);
}

bool Same(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

KeptSecret::KeptSecret(std::uint16_t port) {
  const std::string folder = port == 0 ? "" : StateFolder();
  if (!folder.empty()) {
    std::error_code ignored;  // then it cannot be written either
    std::filesystem::create_directories(folder, ignored);
    path_ = folder + "/stellate-view-" + std::to_string(port);
    value_ = ReadOwn(path_);
  }
  if (!value_.empty()) return;
  value_ = NewSecret();
  if (!path_.empty() && !WriteOwn(path_, value_)) path_.clear();
}

KeptSecret::~KeptSecret() {
  if (!path_.empty()) unlink(path_.c_str());
}

}  // namespace stellate::view
