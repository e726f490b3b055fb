#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mesh/groups.h"
#include "mesh/write_file.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::client {

// A mesh as several .vtu files, its pieces, and the .pvtu file that names them, its index: where
// they are to be.
//
//   name.pvtu  name/name_0.vtu  name/name_1.vtu  ...
class PiecePaths {
 public:
  explicit PiecePaths(const std::string& index);

  // By the ending.
  static bool AreMeantBy(const std::string& path);
  // kFileFailed for a mesh of these dimensions that .pvtu does not hold, and where the index, or
  // that piece, could not be written.
  Expected<void> Check(int dimension, int ambient_dimension, std::size_t piece) const;

  const std::string& index() const { return index_; }
  std::string Piece(std::size_t piece) const { return folder_ + "/" + NameOf(piece); }
  // Returns whether it was not there before; kFileFailed.
  Expected<bool> MakeFolder() const;
  Expected<void> DropIndex() const;         // where there is one
  bool DropPiece(std::size_t piece) const;  // whether there was one
  void DropEmptyFolder() const;             // one that has something in it stays
  // What an index of so many pieces has in it, for a mesh with those groups.
  std::string IndexOf(const Mesh& mesh, const std::vector<Group>& groups, std::size_t pieces) const;

 private:
  std::string NameOf(std::size_t piece) const;

  std::string given_, index_, folder_;  // the latter two beyond symbolic links
};

// Writes one piece: the simplices whose lowest vertex is owned, their points, and of points that
// no simplex has those that are owned. `groups`: all of the mesh's (GroupsOf). `owned`: of each
// vertex. The file is whole, but not yet in its place: Finish puts it there.
Expected<Draft> WritePiece(Draft draft, const Mesh& mesh, const std::vector<Group>& groups,
                           const std::vector<bool>& owned);

}  // namespace stellate::client
