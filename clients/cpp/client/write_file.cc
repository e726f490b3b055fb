#include "write_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace stellate::client {

Expected<void> WriteFile(const std::string& path, std::string_view bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  bool written =
      file != nullptr && std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  if (file != nullptr && std::fclose(file) != 0) written = false;
  if (written) return {};
  return Fail(ErrorCode::kFileFailed, "cannot write " + path + ": " + std::strerror(errno));
}

}  // namespace stellate::client
