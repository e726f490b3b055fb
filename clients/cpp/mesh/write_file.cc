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

bool GiveName(int file, const std::string& name) {
  const std::string own = "/proc/self/fd/" + std::to_string(file);
  return linkat(AT_FDCWD, own.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
}

// A file that is gone if the process is killed, in the folder of `name`, which it can be given
// later; below 0 where the file system has no such files. Another one tries that: a mesh of hours
// must not find out in the end.
int OpenWithoutName(const std::string& name) {
  const std::string folder = std::filesystem::path(name).parent_path().string();
  const auto open_one = [&folder] {
    return open(folder.empty() ? "." : folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
  };
  const int other = open_one();
  if (other < 0) return -1;
  const bool can_be_named = GiveName(other, name);
  if (can_be_named) unlink(name.c_str());
  close(other);
  return can_be_named ? open_one() : -1;
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
    return Draft(path, path, "", file, false);
  }
  const std::string target = Target(path), name = DraftOf(target);
  int file = OpenWithoutName(name);
  const bool has_name = file < 0;
  if (has_name) file = open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return CannotWrite(path, errno);
  Draft draft(path, target, name, file, has_name);
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
      has_name_(std::exchange(other.has_name_, false)),
      end_(other.end_) {}

Draft::~Draft() { Drop(); }

void Draft::Drop() {
  if (file_ >= 0) close(std::exchange(file_, -1));
  if (std::exchange(has_name_, false)) unlink(draft_.c_str());
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
  if (!draft_.empty() && !has_name_) {
    has_name_ = GiveName(file_, draft_);
    if (!has_name_) return CannotWrite(path_, errno);
  }
  if (close(std::exchange(file_, -1)) != 0) return CannotWrite(path_, errno);
  if (draft_.empty()) return {};
  if (rename(draft_.c_str(), target_.c_str()) != 0) return CannotWrite(path_, errno);
  has_name_ = false;
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
