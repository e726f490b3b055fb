#pragma once

#include <string>

namespace stellate::server {

// What the file system says of a file's version: another text after every way of replacing it, in
// place, by renaming, by a symbolic link. Empty: it is not there.
std::string FileStamp(const std::string& path);

}  // namespace stellate::server
