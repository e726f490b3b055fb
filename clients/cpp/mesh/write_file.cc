#include "mesh/write_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace stellate::client {
namespace {

tl::unexpected<Error> CannotWrite(const std::string& path, int why) {
  return Fail(ErrorCode::kFileFailed, "cannot write " + path + ": " + std::strerror(why));
}

// The file that stands for the path, beyond symbolic links.
std::string Target(const std::string& path) {
  std::error_code unknown;
  const std::filesystem::path target = std::filesystem::weakly_canonical(path, unknown);
  return unknown ? path : target.string();
}

// A pipe or a device: written as it is, since nothing may take its place.
bool IsSpecial(const std::string& path) {
  struct stat status;
  return stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode);
}

// 0, or what went wrong.
int Fill(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(file, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return 0;
}

int WriteThrough(const std::string& path, std::string_view bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const int wrong = Fill(file, bytes);
  return close(file) != 0 && wrong == 0 ? errno : wrong;
}

// Beside the target, and renamed once it is whole and on disk.
int Replace(const std::string& target, std::string_view bytes) {
  const std::string draft = target + ".part-" + std::to_string(getpid());
  const int file = open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return errno;
  struct stat old;
  int wrong = stat(target.c_str(), &old) == 0 && fchmod(file, old.st_mode & 07777) != 0 ? errno : 0;
  if (wrong == 0) wrong = Fill(file, bytes);
  if (wrong == 0 && fsync(file) != 0) wrong = errno;
  if (close(file) != 0 && wrong == 0) wrong = errno;
  if (wrong == 0 && rename(draft.c_str(), target.c_str()) != 0) wrong = errno;
  if (wrong != 0) unlink(draft.c_str());
  return wrong;
}

}  // namespace

Expected<void> WriteFile(const std::string& path, std::string_view bytes) {
  const int wrong = IsSpecial(path) ? WriteThrough(path, bytes) : Replace(Target(path), bytes);
  if (wrong != 0) return CannotWrite(path, wrong);
  return {};
}

Expected<void> CheckWrite(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) return CannotWrite(path, EISDIR);
  std::filesystem::path place = path;
  if (!IsSpecial(path)) place = std::filesystem::absolute(Target(path)).parent_path();
  if (access(place.c_str(), W_OK) != 0) return CannotWrite(path, errno);
  return {};
}

}  // namespace stellate::client
