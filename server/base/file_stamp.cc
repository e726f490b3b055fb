#include "server/base/file_stamp.h"

#include <sys/stat.h>

#include "core/base/message.h"

namespace stellate::server {

std::string FileStamp(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) return "";
  return core::Message(info.st_dev, ".", info.st_ino, ".", info.st_size, ".", info.st_mtim.tv_sec,
                       ".", info.st_mtim.tv_nsec, ".", info.st_ctim.tv_sec, ".",
                       info.st_ctim.tv_nsec);
}

}  // namespace stellate::server
