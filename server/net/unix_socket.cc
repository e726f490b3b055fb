#include "server/net/unix_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/base/message.h"

namespace stellate::server {

using core::Message;
using core::Status;
using core::StatusCode;

core::Status ClearUnixPath(const std::string& path) {
  const std::filesystem::path directory = std::filesystem::path(path).parent_path();
  if (access(directory.empty() ? "." : directory.c_str(), W_OK | X_OK) != 0) {
    return {StatusCode::kFailedPrecondition,
            Message("--listen is unix:", path,
                    " but no socket can be made in its directory: ", std::strerror(errno))};
  }
  struct stat info {};
  if (lstat(path.c_str(), &info) != 0) return Status::Ok();
  if (!S_ISSOCK(info.st_mode)) {
    return {StatusCode::kFailedPrecondition, Message("--listen is unix:", path,
                                                     " but a file that is no socket stands there: "
                                                     "choose another path")};
  }
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  const int result = connect(probe, reinterpret_cast<sockaddr*>(&address), sizeof(address));
  const bool refused = result != 0 && errno == ECONNREFUSED;
  close(probe);
  if (!refused) {
    return {StatusCode::kFailedPrecondition,
            Message("--listen is unix:", path,
                    " but another server listens there: stop it, or "
                    "choose another path")};
  }
  unlink(path.c_str());
  return Status::Ok();
}

}  // namespace stellate::server
