#include <filesystem>
#include <new>

#include "oracles/combined/common.h"
#include "oracles/files/contents.h"
#include "oracles/files/formats.h"

namespace stellate::oracles {
namespace {

const files::Format& FormatOf(const std::filesystem::path& path) {
  const std::string ending = files::EndingOf(path);
  for (const files::Format& format : files::kFormats) {
    if (ending == format.ending) return format;
  }
  Refuse("files that are read end in .off, .ply, .stl or .obj");
}

}  // namespace

Triangles ReadTriangles(const std::string& path) {
  const std::string begin = "'" + path + "' cannot be read as a mesh: ";
  try {
    const files::Format& format = FormatOf(path);
    return format.parse(files::Contents(path));
  } catch (const std::invalid_argument& e) {
    Refuse(begin + e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    Refuse(begin + e.what());
  } catch (const std::bad_alloc&) {
    Refuse(begin + "it is too large for the memory that is left");
  }
}

}  // namespace stellate::oracles
