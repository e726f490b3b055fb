#pragma once

#include <sys/stat.h>
#include <sys/types.h>

namespace stellate::server {

// A socket's inode, which distinguishes it from later users of its file descriptor. 0: not a
// socket.
inline ino_t NumberOf(int fd) {
  struct stat info {};
  return fstat(fd, &info) == 0 && S_ISSOCK(info.st_mode) ? info.st_ino : 0;
}

}  // namespace stellate::server
