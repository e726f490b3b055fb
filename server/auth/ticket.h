#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace stellate::server {

// What a server says of a call that it passes on to another: for whom it is, in place of the
// caller's own token. Signed with the secret that the servers share, for one server alone and a
// minute of its beats, so that it is worth nothing elsewhere, and soon nothing at all. No clock is
// compared with another machine's: both have the beats from the database.
struct Ticket {
  std::int64_t server = 0;  // that it is meant for
  std::int64_t beat = 0;    // of that server, as the one that passes the call on has seen it
  std::string owner;
  bool administrator = false;
  std::string address;  // where the call comes from

  bool operator==(const Ticket&) const = default;
};

// The value of the metadata "authorization" of such a call.
std::string Sign(const Ticket& ticket, const std::string& secret);
// Whether it is one, whatever it is worth.
bool IsTicket(std::string_view authorization);
// Nothing: it was signed with another secret, or is no ticket.
std::optional<Ticket> ReadTicket(std::string_view authorization, const std::string& secret);

}  // namespace stellate::server
