#pragma once

#include <memory>
#include <string>

#include "mesh/formats.h"

namespace stellate::client {

// Whether a mesh of these dimensions can be written to the path in the order in which it comes, one
// group of it: not what a format groups by walls and labels, what it draws of a solid, .stl, which
// has corners instead of ids, and pipes, which cannot be taken back.
bool CanStream(const std::string& path, int k, int d, bool has_walls);

// A file that CanStream takes, on its way. `shape` has one group.
struct StreamedFile {
  static Expected<StreamedFile> Begin(const std::string& path, const FileShape& shape);

  std::unique_ptr<MeshWriter> writer;
  bool is_turned = false;  // cells are to be turned to agree; else they are ascending ids
};

}  // namespace stellate::client
