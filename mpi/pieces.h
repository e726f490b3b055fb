#pragma once

#include <string>
#include <vector>

#include "core/peers.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::mpi {

// Has all parts go on, or none: the first part's error that has one.
Expected<void> Agree(const core::Peers& peers, const Expected<void>& own);

// Writes a mesh, which all parts have, as one file a part, which each part writes itself, and the
// index that names them: all or none of them. Each has about equally many vertices, in a box of
// space. In all parts.
Expected<void> SavePieces(const Mesh& mesh, const std::string& index, const core::Peers& peers);

}  // namespace stellate::mpi
