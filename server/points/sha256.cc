#include "server/points/sha256.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace stellate::server {
namespace {

struct Release {
  void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
};
using Handle = std::unique_ptr<EVP_MD_CTX, Release>;

// What a library without it returns would be taken for a digest.
void Insist(bool done) {
  if (!done) throw std::runtime_error("SHA-256 is not available");
}

}  // namespace

struct Sha256::Context {
  Handle handle{EVP_MD_CTX_new()};
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  Insist(context_->handle != nullptr &&
         EVP_DigestInit_ex(context_->handle.get(), EVP_sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;

void Sha256::Add(const void* data, std::size_t bytes) {
  Insist(EVP_DigestUpdate(context_->handle.get(), data, bytes) == 1);
}

std::string Sha256::Value() const {
  const Handle copy(EVP_MD_CTX_new());
  std::string digest(static_cast<std::size_t>(EVP_MD_size(EVP_sha256())), '\0');
  unsigned size = 0;
  Insist(copy != nullptr && EVP_MD_CTX_copy_ex(copy.get(), context_->handle.get()) == 1 &&
         EVP_DigestFinal_ex(copy.get(), reinterpret_cast<unsigned char*>(digest.data()), &size) ==
             1);
  return digest;
}

std::string Hexadecimal(const std::string& bytes) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const char byte : bytes) {
    text += kDigits[static_cast<unsigned char>(byte) >> 4];
    text += kDigits[static_cast<unsigned char>(byte) & 15];
  }
  return text;
}

}  // namespace stellate::server
