#pragma once

#include <string>

#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::client {

// The contents of a mesh's file; save.cc says which meshes each may be asked for. Numbers are
// little endian where they are not text.
std::string Txt(const Mesh& mesh);
std::string Off(const Mesh& mesh);
std::string Ply(const Mesh& mesh);
std::string Obj(const Mesh& mesh);
std::string Msh(const Mesh& mesh);  // Gmsh's, version 2.2, text
std::string Vtu(const Mesh& mesh);
// Binary. kFileFailed for a mesh that is too fine for single precision.
Expected<std::string> Stl(const Mesh& mesh);

// The first three coordinates of each point, zeros added.
Eigen::MatrixXd InSpace(const Mesh& mesh);

}  // namespace stellate::client
