#pragma once

#include <memory>
#include <string>

#include "mesh/formats.h"
#include "mesh/spool.h"

namespace stellate::client {

// Whether a mesh of these dimensions can be written to the path as it comes, held nowhere: not what
// a format draws of a solid, .stl, which has corners instead of ids, a boundary alone where it is
// grouped by walls, and pipes, which cannot be taken back.
bool CanStream(const std::string& path, int k, int d, bool has_walls, bool is_boundary);

// Of a path that CanStream takes: whether SaveSpooled writes it, and no StreamedFile.
bool NeedsGroups(const std::string& path, int k, int d, bool has_walls);

// Writes what a spool has; `shape`: without groups. False, and no file: the mesh has to be written
// whole.
Expected<bool> SaveSpooled(const std::string& path, const Spool& spool, FileShape shape);

// A file on its way that is written in the order in which a mesh comes. `shape` has one group.
struct StreamedFile {
  static Expected<StreamedFile> Begin(const std::string& path, const FileShape& shape);

  std::unique_ptr<MeshWriter> writer;
  bool is_turned = false;  // cells are to be turned to agree; else they are ascending ids
};

}  // namespace stellate::client
