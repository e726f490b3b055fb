#include "server/auth/auth.h"

#include <grpc/grpc_security_constants.h>
#include <grpcpp/security/auth_context.h>
#include <strings.h>

#include <string_view>
#include <utility>

#include "server/auth/ticket.h"
#include "server/convert/error_map.h"

namespace stellate::server {
namespace {

constexpr char kHeader[] = "authorization";
constexpr std::string_view kScheme = "Bearer ";
constexpr std::int64_t kTicketBeats = 60;  // for which a ticket is good: about a minute

tl::unexpected<grpc::Status> Unauthenticated(const std::string& message) {
  return tl::unexpected(Refusal(v1::ERROR_REASON_UNAUTHENTICATED, message));
}

std::string FirstProperty(const grpc::AuthContext& context, const char* name) {
  const auto values = context.FindPropertyValues(name);
  return values.empty() ? "" : std::string(values.front().data(), values.front().size());
}

// What the certificate authority vouches for. '=' keeps these apart from owners of tokens.
std::string OwnerIn(const grpc::AuthContext& context) {
  std::string subject = FirstProperty(context, GRPC_X509_SUBJECT_PROPERTY_NAME);
  if (!subject.empty()) return subject;
  const std::string name = FirstProperty(context, GRPC_X509_SAN_PROPERTY_NAME);
  return name.empty() ? "" : "SAN=" + name;
}

bool IsBearer(std::string_view value) {
  return value.size() > kScheme.size() &&
         strncasecmp(value.data(), kScheme.data(), kScheme.size()) == 0;
}

// Empty: none, or several.
std::string_view AuthorizationIn(const grpc::ServerContextBase& context) {
  const auto [first, last] = context.client_metadata().equal_range(kHeader);
  if (first == last || std::next(first) != last) return "";
  return {first->second.data(), first->second.size()};
}

tl::expected<TokenDigest, grpc::Status> TokenIn(const grpc::ServerContextBase& context) {
  const auto [first, last] = context.client_metadata().equal_range(kHeader);
  if (first == last) {
    return Unauthenticated(
        "no token came: send the metadata \"authorization\" with \"Bearer TOKEN\"");
  }
  const std::string_view value(first->second.data(), first->second.size());
  if (std::next(first) != last || !IsBearer(value)) {
    return Unauthenticated("the metadata \"authorization\" must be one value, \"Bearer TOKEN\"");
  }
  return Digest(value.substr(kScheme.size()));
}

}  // namespace

core::Expected<std::unique_ptr<Authenticator>> Authenticator::Create(const Config& config) {
  auto authenticator = std::make_unique<Authenticator>();
  authenticator->by_certificate_ = !config.tls_client_ca.empty();
  if (config.token_file.empty()) return authenticator;
  auto tokens = TokenFile::Open(config.token_file);
  if (!tokens) return tl::unexpected(std::move(tokens.error()));
  authenticator->tokens_ = std::move(*tokens);
  return authenticator;
}

tl::expected<Identity, grpc::Status> Authenticator::Identify(
    const grpc::ServerContextBase& context) const {
  if (const auto authorization = AuthorizationIn(context);
      !peers_.secret.empty() && IsTicket(authorization)) {
    return IdentifyPassedOn(authorization);
  }
  if (tokens_ != nullptr) {
    const auto digest = TokenIn(context);
    if (!digest) return tl::unexpected(digest.error());
    auto holder = tokens_->HolderOf(*digest);
    if (!holder) return Unauthenticated("the token is not known to this server");
    return Identity{std::move(holder->owner), *digest, holder->administrator, false, ""};
  }
  if (!by_certificate_) return Identity{};
  std::string owner = OwnerIn(*context.auth_context());
  if (owner.empty()) return Unauthenticated("the client certificate names no owner");
  return Identity{std::move(owner), std::nullopt, false, false, ""};
}

tl::expected<Identity, grpc::Status> Authenticator::IdentifyPassedOn(
    std::string_view authorization) const {
  auto ticket = ReadTicket(authorization, peers_.secret);
  if (!ticket) return Unauthenticated("no server of this database signed the call");
  if (ticket->server != peers_.number() || peers_.beat() - ticket->beat > kTicketBeats) {
    return tl::unexpected(
        Refusal(v1::ERROR_REASON_SHUTTING_DOWN,
                "the call was meant for an earlier server, or passed on long ago: call again"));
  }
  return Identity{std::move(ticket->owner), std::nullopt, ticket->administrator, true,
                  std::move(ticket->address)};
}

bool Authenticator::Knows(std::string_view authorization) const {
  if (!peers_.secret.empty() && IsTicket(authorization)) {
    return ReadTicket(authorization, peers_.secret).has_value();
  }
  return tokens_ != nullptr && IsBearer(authorization) &&
         tokens_->HolderOf(Digest(authorization.substr(kScheme.size())));
}

bool Authenticator::StillHolds(const Identity& identity) const {
  return tokens_ == nullptr || identity.is_passed_on ||  // the server that knows him sees to it
         (identity.token && tokens_->HolderOf(*identity.token) ==
                                TokenHolder{identity.owner, identity.administrator});
}

double Authenticator::WeightOf(const std::string& owner) const {
  return tokens_ == nullptr ? 1 : tokens_->WeightOf(owner);
}

void Authenticator::Reload(bool force) {
  if (tokens_ != nullptr) tokens_->Reload(force);
}

grpc::Status TokenWithdrawn() {
  return Refusal(v1::ERROR_REASON_UNAUTHENTICATED, "the token is not valid any more");
}

}  // namespace stellate::server
