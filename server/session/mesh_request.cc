#include "server/session/mesh_request.h"

#include "core/base/message.h"

namespace stellate::server {

std::string VerdictOf(const MeshRequest& request, const std::string& verdict) {
  const std::string& about = request.about;
  if (about.empty() || verdict.empty()) return verdict;
  return core::Message(verdict, verdict.ends_with('.') ? "" : ".",
                       " The oracle says of itself: ", about, about.ends_with('.') ? "" : ".");
}

}  // namespace stellate::server
