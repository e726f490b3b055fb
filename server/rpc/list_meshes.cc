#include <charconv>
#include <optional>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {
namespace {

constexpr std::uint32_t kDefaultPage = 100;
constexpr std::uint32_t kLargestPage = 1000;

std::string TokenOf(std::int64_t server, std::uint64_t mesh) {
  if (server == 0) return std::to_string(mesh);
  return core::Message(std::to_string(server), ".", std::to_string(mesh));
}

}  // namespace

// A page ends early when it grows too large for a message: boxes have d numbers each.
grpc::Status ListMeshes(const Call& call, const v1::ListMeshesRequest& request,
                        v1::ListMeshesResponse* response) {
  std::uint64_t after = 0;
  const Router& router = call.state.router;
  auto [server, token] = Router::ReadPageToken(request.page_token());
  const std::int64_t number = router.number();
  if (server != number) token.clear();  // another's, which is gone
  if (server > number) return grpc::Status::OK;
  if (!token.empty()) {
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), after);
    if (error != std::errc() || end != token.data() + token.size()) {
      return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                     core::Message("page_token is \"", Cut(request.page_token(), 100),
                                   "\" but must be a next_page_token of an earlier reply"),
                     "page_token");
    }
  }
  const std::uint32_t size = request.page_size() == 0 ? kDefaultPage : request.page_size();
  const SessionStore::Page page = call.state.store.List(
      after, std::min(size, kLargestPage),
      call.caller.administrator ? std::nullopt : std::optional(call.caller.owner));
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < page.sessions.size(); ++i) {
    v1::Mesh* const mesh = response->add_meshes();
    ShowMesh(call, *page.sessions[i], mesh);
    bytes += mesh->ByteSizeLong();
    const bool full = bytes >= ChunkBytes(*call.state.config()) / 2;
    const bool last = i + 1 == page.sessions.size();
    if ((last && page.more) || (!last && full)) {
      response->set_next_page_token(TokenOf(number, page.numbers[i]));
      return grpc::Status::OK;
    }
  }
  const std::int64_t next = router.NumberAfter(number);
  if (number != 0 && next != 0) response->set_next_page_token(TokenOf(next, 0));
  return grpc::Status::OK;
}

}  // namespace stellate::server
