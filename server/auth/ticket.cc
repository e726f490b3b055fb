#include "server/auth/ticket.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <array>
#include <charconv>

#include "core/base/message.h"

namespace stellate::server {
namespace {

constexpr std::string_view kTicketScheme = "Stellate-Server ";
constexpr std::size_t kDigestBytes = 32;

std::string Hex(std::string_view bytes) {
  static constexpr char kHex[] = "0123456789abcdef";
  std::string text;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kHex[byte >> 4];
    text += kHex[byte & 15];
  }
  return text;
}

std::optional<std::string> Unhex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    unsigned byte = 0;
    const auto [end, error] = std::from_chars(&text[i], &text[i] + 2, byte, 16);
    if (error != std::errc() || end != &text[i] + 2) return std::nullopt;
    bytes += static_cast<char>(byte);
  }
  return bytes;
}

std::string DigestOf(std::string_view words, const std::string& secret) {
  std::array<unsigned char, kDigestBytes> digest{};
  unsigned size = 0;
  const bool done = HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
                         reinterpret_cast<const unsigned char*>(words.data()), words.size(),
                         digest.data(), &size) != nullptr;
  return done ? std::string(digest.begin(), digest.begin() + size) : "";
}

// Up to the next line's end, which is taken off as well.
std::string_view TakeLine(std::string_view* rest) {
  const std::size_t end = std::min(rest->find('\n'), rest->size());
  const std::string_view line = rest->substr(0, end);
  rest->remove_prefix(std::min(end + 1, rest->size()));
  return line;
}

}  // namespace

std::string Sign(const Ticket& ticket, const std::string& secret) {
  const std::string words =
      core::Message(std::to_string(ticket.server), "\n", std::to_string(ticket.beat), "\n",
                    ticket.administrator ? "1" : "0", "\n", ticket.address, "\n", ticket.owner);
  return core::Message(kTicketScheme, Hex(words), ".", Hex(DigestOf(words, secret)));
}

bool IsTicket(std::string_view authorization) { return authorization.starts_with(kTicketScheme); }

std::optional<Ticket> ReadTicket(std::string_view authorization, const std::string& secret) {
  if (!IsTicket(authorization) || secret.empty()) return std::nullopt;
  authorization.remove_prefix(kTicketScheme.size());
  const std::size_t dot = authorization.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const auto words = Unhex(authorization.substr(0, dot));
  const auto digest = Unhex(authorization.substr(dot + 1));
  if (!words || !digest || digest->size() != kDigestBytes) return std::nullopt;
  const std::string right = DigestOf(*words, secret);
  if (right.size() != kDigestBytes ||
      CRYPTO_memcmp(right.data(), digest->data(), kDigestBytes) != 0) {
    return std::nullopt;
  }
  std::string_view rest = *words;
  Ticket ticket;
  for (std::int64_t* const number : {&ticket.server, &ticket.beat}) {
    const std::string_view digits = TakeLine(&rest);
    std::from_chars(digits.data(), digits.data() + digits.size(), *number);
  }
  ticket.administrator = TakeLine(&rest) == "1";
  ticket.address = TakeLine(&rest);
  ticket.owner = rest;
  return ticket;
}

}  // namespace stellate::server
