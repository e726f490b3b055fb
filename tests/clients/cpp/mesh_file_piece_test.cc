#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "mesh/groups.h"
#include "mesh/piece.h"
#include "mesh/write_file.h"
#include "mesh_file_fixture.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

TEST_F(MeshFile, PvtuIsOfManyProcesses) {
  EXPECT_NE(Refusal(Surface(3), "a.pvtu").find("stellate-mpi"), std::string::npos);
}

TEST_F(MeshFile, APieceHasTheSimplicesOfItsVerticesAndTheirPoints) {
  const Mesh mesh = Surface(4);
  const auto groups = client::GroupsOf(mesh);
  // The simplex 1 2 3; of no other is one of them the lowest vertex.
  Expected<client::Draft> piece = client::WritePiece(*client::Draft::Begin(Path("a.vtu")), mesh,
                                                     groups, {false, true, false, true});
  ASSERT_TRUE(piece.has_value()) << piece.error().message;
  EXPECT_FALSE(std::filesystem::exists(Path("a.vtu")));
  ASSERT_TRUE(piece->Finish().has_value());
  EXPECT_EQ(InPython("import meshio; m = meshio.read(sys.argv[1]); d = m.point_data; "
                     "assert d['GlobalPointIds'].ravel().tolist() == [1, 2, 3]; "
                     "assert d['coordinates'][2].tolist() == [0, 0, 0, 12345678.9]; "
                     "assert len(m.cells) == 1; "
                     "assert sorted(m.cells[0].data[0].tolist()) == [0, 1, 2]",
                     Path("a.vtu")),
            0);
}

TEST_F(MeshFile, APointWithoutSimplicesIsInThePieceOfItsOwner) {
  Mesh mesh = Surface(3);
  mesh.simplices = mesh.simplices.leftCols(1).eval();  // 0 1 2
  const auto groups = client::GroupsOf(mesh);
  for (const bool has_alone : {true, false}) {
    Expected<client::Draft> piece = client::WritePiece(*client::Draft::Begin(Path("a.vtu")), mesh,
                                                       groups, {true, false, false, has_alone});
    ASSERT_TRUE(piece.has_value() && piece->Finish().has_value());
    EXPECT_EQ(InPython("import meshio; d = meshio.read(sys.argv[1]).point_data; "
                       "assert d['GlobalPointIds'].ravel().tolist() == " +
                           std::string(has_alone ? "[0, 1, 2, 3]" : "[0, 1, 2]"),
                       Path("a.vtu")),
              0);
  }
}

TEST_F(MeshFile, AnIndexNamesPiecesBesideIt) {
  const client::PiecePaths paths(Path("a&b.pvtu"));
  EXPECT_EQ(paths.Piece(2), Path("a&b/a&b_2.vtu"));
  const Mesh mesh = Surface(3);
  const std::string index = paths.IndexOf(mesh, client::GroupsOf(mesh), 2);
  EXPECT_NE(index.find("<Piece Source=\"a&amp;b/a&amp;b_1.vtu\"/>"), std::string::npos);
  EXPECT_NE(index.find("<PPointData GlobalIds=\"GlobalPointIds\">"), std::string::npos);
  EXPECT_TRUE(paths.Check(2, 3, 0).has_value());
  EXPECT_FALSE(paths.Check(4, 5, 0).has_value());
  std::filesystem::create_directories(paths.Piece(1));
  EXPECT_TRUE(paths.Check(2, 3, 0).has_value());
  EXPECT_FALSE(paths.Check(2, 3, 1).has_value());
}

}  // namespace
}  // namespace stellate
