#pragma once

#include <sys/stat.h>
#include <sys/types.h>

namespace stellate::server {

// Tells a socket from whatever has its file descriptor after it. Zero: it is no socket any more.
inline ino_t NumberOf(int fd) {
  struct stat info {};
  return fstat(fd, &info) == 0 && S_ISSOCK(info.st_mode) ? info.st_ino : 0;
}

}  // namespace stellate::server
