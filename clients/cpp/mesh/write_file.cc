#include "mesh/write_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

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

std::string DraftOf(const std::string& target) {
  static std::atomic<unsigned> count = 0;
  return target + ".part-" + std::to_string(getpid()) + "-" + std::to_string(++count);
}

}  // namespace

bool Draft::IsSpecial(const std::string& path) {
  struct stat status;
  return stat(path.c_str(), &status) == 0 && !S_ISREG(status.st_mode);
}

Expected<Draft> Draft::Begin(const std::string& path) {
  if (IsSpecial(path)) {
    const int file = open(path.c_str(), O_WRONLY | O_CLOEXEC);
    if (file < 0) return CannotWrite(path, errno);
    return Draft(path, path, "", file);
  }
  const std::string target = Target(path), name = DraftOf(target);
  const int file = open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return CannotWrite(path, errno);
  Draft draft(path, target, name, file);
  struct stat old;
  if (stat(target.c_str(), &old) == 0 && fchmod(file, old.st_mode & 07777) != 0)
    return CannotWrite(path, errno);
  return draft;
}

Draft::Draft(Draft&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      draft_(std::exchange(other.draft_, {})),
      file_(std::exchange(other.file_, -1)),
      end_(other.end_) {}

Draft::~Draft() { Drop(); }

void Draft::Drop() {
  if (file_ >= 0) close(std::exchange(file_, -1));
  if (!draft_.empty()) unlink(std::exchange(draft_, {}).c_str());
}

Expected<void> Draft::WriteAt(std::uint64_t place, std::string_view bytes) {
  if (draft_.empty() && place != end_) return CannotWrite(path_, ESPIPE);
  while (!bytes.empty()) {
    const ssize_t count =
        draft_.empty() ? write(file_, bytes.data(), bytes.size())
                       : pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(place));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return CannotWrite(path_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(count));
    place += static_cast<std::uint64_t>(count);
    end_ = std::max(end_, place);
  }
  return {};
}

Expected<void> Draft::Keep() {
  if (!draft_.empty() && fsync(file_) != 0) return CannotWrite(path_, errno);
  return {};
}

Expected<void> Draft::Finish() {
  if (auto ok = Keep(); !ok) return ok;
  if (close(std::exchange(file_, -1)) != 0) return CannotWrite(path_, errno);
  if (draft_.empty()) return {};
  if (rename(draft_.c_str(), target_.c_str()) != 0) return CannotWrite(path_, errno);
  draft_.clear();
  return {};
}

Expected<void> WriteFile(const std::string& path, std::string_view bytes) {
  Expected<Draft> draft = Draft::Begin(path);
  if (!draft) return tl::unexpected(draft.error());
  if (auto ok = draft->Write(bytes); !ok) return ok;
  return draft->Finish();
}

Expected<void> CheckWrite(const std::string& path) {
  struct stat status;
  if (stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) return CannotWrite(path, EISDIR);
  std::filesystem::path place = path;
  if (!Draft::IsSpecial(path)) place = std::filesystem::absolute(Target(path)).parent_path();
  if (access(place.c_str(), W_OK) != 0) return CannotWrite(path, errno);
  return {};
}

}  // namespace stellate::client
