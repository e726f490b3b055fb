#include "oracles/files/contents.h"

#include <fstream>
#include <system_error>

#include "oracles/combined/common.h"

namespace stellate::oracles::files {

std::string Contents(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::filesystem::file_status status = std::filesystem::status(path, ignored);
  if (!std::filesystem::exists(status)) Refuse("it is not there");
  // A device or a pipe may have no end.
  if (!std::filesystem::is_regular_file(status)) Refuse("it is no file");
  std::string bytes(std::filesystem::file_size(path), '\0');
  std::ifstream file(path, std::ios::binary);
  if (!file.read(bytes.data(), std::ssize(bytes))) Refuse("it may not be read, or only in part");
  return bytes;
}

std::string EndingOf(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  return ending;
}

}  // namespace stellate::oracles::files
