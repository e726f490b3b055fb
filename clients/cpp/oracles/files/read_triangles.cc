#include <filesystem>
#include <fstream>
#include <new>

#include "oracles/combined/common.h"
#include "oracles/files/formats.h"

namespace stellate::oracles {
namespace {

const files::Format& FormatOf(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  for (const files::Format& format : files::kFormats) {
    if (ending == format.ending) return format;
  }
  Refuse("files that are read end in .off, .ply, .stl or .obj");
}

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

}  // namespace

Triangles ReadTriangles(const std::string& path) {
  const std::string begin = "'" + path + "' cannot be read as a mesh: ";
  try {
    const files::Format& format = FormatOf(path);
    return format.parse(Contents(path));
  } catch (const std::invalid_argument& e) {
    Refuse(begin + e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    Refuse(begin + e.what());
  } catch (const std::bad_alloc&) {
    Refuse(begin + "it is too large for the memory that is left");
  }
}

}  // namespace stellate::oracles
