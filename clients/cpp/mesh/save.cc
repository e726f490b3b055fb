#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

#include "mesh/formats.h"
#include "mesh/write_file.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

using client::Msh, client::Obj, client::Off, client::Ply, client::Stl, client::Txt, client::Vtu;

using Writer = Expected<std::string> (*)(const Mesh&);

struct FileFormat {
  const char* ending;
  int least_dimension, largest_dimension;  // of what it can hold
  int largest_ambient_dimension;
  const char* holds;
  Writer write;
  bool surface_of_solids = false;  // in space, besides
};

template <auto kWrite>
Expected<std::string> As(const Mesh& mesh) {
  return kWrite(mesh);
}

constexpr int kAny = 1 << 30;
constexpr FileFormat kFormats[] = {
    {".txt", 0, kAny, kAny, "anything", As<Txt>},
    {".off", 1, 2, kAny, "curves and surfaces, and the surfaces of solids in space", As<Off>, true},
    {".obj", 1, 2, 3, "curves and surfaces, and the surfaces of solids in space", As<Obj>, true},
    {".ply", 1, 2, 3, "curves and surfaces, and the surfaces of solids in space", As<Ply>, true},
    {".stl", 2, 2, 3, "surfaces, and the surfaces of solids in space", As<Stl>, true},
    {".msh", 1, 3, 3, "simplices of dimension 3 at most", As<Msh>},
    {".vtu", 1, 3, kAny, "simplices of dimension 3 at most", As<Vtu>},
};

bool Holds(const FileFormat& format, int k, int d) {
  if (format.surface_of_solids && k == 3 && d == 3) return true;
  return format.least_dimension <= k && k <= format.largest_dimension &&
         d <= format.largest_ambient_dimension;
}

std::string EndingOf(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return ending;
}

Expected<const FileFormat*> Choose(const std::string& path, int k, int d) {
  std::string able;
  for (const FileFormat& format : kFormats) {
    if (Holds(format, k, d)) able += std::string(" ") + format.ending;
  }
  const std::string ending = EndingOf(path);
  const auto* const format = std::find_if(std::begin(kFormats), std::end(kFormats),
                                          [&](const FileFormat& f) { return ending == f.ending; });
  if (format == std::end(kFormats)) {
    return Fail(ErrorCode::kFileFailed, "no format is known by the ending '" + ending + "' of " +
                                            path + "; known for this mesh:" + able);
  }
  if (Holds(*format, k, d)) return format;
  const bool high = k >= format->least_dimension && k <= format->largest_dimension;
  return Fail(ErrorCode::kFileFailed,
              ending + " holds " + (high ? "points of space" : format->holds) + ", and " + path +
                  " would get a mesh of dimension " + std::to_string(k) + " in R^" +
                  std::to_string(d) + "; known for it:" + able);
}

}  // namespace

Expected<void> CheckSave(const std::string& path, int dimension, int ambient_dimension) {
  const auto format = Choose(path, dimension, ambient_dimension);
  if (!format) return tl::unexpected(format.error());
  return client::CheckWrite(path);
}

Expected<void> Mesh::Save(const std::string& path) const {
  const auto format = Choose(path, dimension(), ambient_dimension());
  if (!format) return tl::unexpected(format.error());
  const Expected<std::string> bytes = (*format)->write(*this);
  if (!bytes) return tl::unexpected(bytes.error());
  return client::WriteFile(path, *bytes);
}

}  // namespace stellate
