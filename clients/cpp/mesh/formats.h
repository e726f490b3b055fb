#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mesh/groups.h"
#include "mesh/write_file.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate::client {

// Points or cells that are in memory at a time, where they need not be.
inline constexpr std::size_t kBlockRows = std::size_t{1} << 14;

// The walls of points, as bits: the ids, ascending, of those that are on some.
struct PointWalls {
  std::vector<std::uint32_t> on;
  std::vector<std::uint64_t> bits;  // of each of them
};

// What a file is to hold, before any of it is there.
struct FileShape {
  struct Cells {
    int dimension = 0;
    std::uint64_t count = 0;
    int tag = 1;
    std::string name = {};  // of one of several groups
  };
  int dimension = 0, ambient_dimension = 0;
  std::uint64_t vertices = 0;
  std::vector<Cells> groups = {};
  Report report = {};  // of a mesh that is over
  std::optional<PointWalls> walls = {};
  bool has_labels = false;  // its cells; also those of a boundary alone
  std::optional<std::vector<std::int64_t>> point_ids = {};  // of a piece: the mesh's own

  std::uint64_t simplices() const;
};

// A file on its way, a block at a time. What is not finished leaves no file.
class MeshWriter {
 public:
  virtual ~MeshWriter() = default;
  // Some columns more, all points before any cells; cells group after group, as they are turned.
  virtual Expected<void> AddPoints(const Eigen::Ref<const Eigen::MatrixXd>& points) = 0;
  virtual Expected<void> AddCells(std::size_t group,
                                  const Eigen::Ref<const SimplexMatrix>& cells) = 0;
  virtual Expected<void> Finish() = 0;
};

// How a format of text is laid out around the numbers; save.cc says what each is asked to hold.
struct TextLayout {
  struct Cells {
    std::string before, prefix;  // of all of a group, and of each line
  };
  std::string head, middle = {}, end = {};  // before, between and after points and cells
  std::string point_prefix = {};
  std::vector<Cells> groups = {};
  bool in_space = false;  // of points the first three coordinates, zeros added
  bool numbered = false;  // lines begin with their number
  int first_id = 0;
};
TextLayout Txt(const FileShape& shape);
TextLayout Off(const FileShape& shape);
TextLayout Obj(const FileShape& shape);
TextLayout Msh(const FileShape& shape);  // Gmsh's, version 2.2
std::unique_ptr<MeshWriter> MakeTextWriter(Draft draft, TextLayout layout);

// Stanford's, binary, little endian, in double precision.
std::unique_ptr<MeshWriter> MakePlyWriter(Draft draft, const FileShape& shape);

// VTK's XML with raw appended data. `groups`: what there is to say of those of `shape`; null: it
// is one, with nothing to say.
std::unique_ptr<MeshWriter> MakeVtuWriter(Draft draft, FileShape shape,
                                          const std::vector<Group>* groups = nullptr);

// One of several such files that are one mesh together; `shape` has point_ids. It is whole, but not
// yet in its place: Finish puts it there.
Expected<Draft> WriteVtuPiece(Draft draft, FileShape shape, const Eigen::MatrixXd& points,
                              const std::vector<Group>& groups);
// The contents of the .pvtu file that names them, by paths relative to it. `shape`: of any of them.
std::string VtuIndex(const FileShape& shape, const std::vector<std::string>& sources);

// Whole files, binary, little endian. kFileFailed for a mesh that is too fine for single precision,
// which .stl and .glb have, and of .3mf and .glb for one without triangles.
Expected<std::string> Npz(const Mesh& mesh);
Expected<std::string> Stl(const Mesh& mesh);
Expected<std::string> ThreeMf(const Mesh& mesh);
Expected<std::string> Glb(const Mesh& mesh);
// Nastran's bulk data, text: rods, triangles or tetrahedra; regions are their properties.
// kFileFailed for a mesh whose numbers take more than eight digits.
Expected<std::string> Nastran(const Mesh& mesh);

// The first three coordinates of each point, zeros added.
Eigen::MatrixXd InSpace(const Eigen::Ref<const Eigen::MatrixXd>& points);

}  // namespace stellate::client
