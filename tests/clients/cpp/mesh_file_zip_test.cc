#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <string>

#include "mesh/write_file.h"
#include "mesh/zip.h"
#include "mesh_file_fixture.h"
#include "stellate/mesh.h"

namespace stellate {
namespace {

TEST_F(MeshFile, NpzHoldsNamesOfAnyCharacters) {
  Mesh mesh = Surface(3);
  mesh.labels = {1, 2, 1, 2};
  mesh.region_names = {"\xc3\xa9t\xc3\xa9", "", "\xff"};  // the last is no UTF-8
  Saved(mesh, "a.npz");
  EXPECT_EQ(
      InPython("import numpy; a = numpy.load(sys.argv[1]); names = a['region_names'].tolist(); "
               "sys.exit(names != ['\\xe9t\\xe9', '', '\\ufffd'] or a['labels'].tolist() != [1, 2, "
               "1, 2])",
               Path("a.npz")),
      0);
}

TEST_F(MeshFile, AnotherProgramReadsZipFilesOfBothKinds) {
  for (const std::uint64_t largest : {0xFFFFFFFEull, 200ull, 0ull}) {
    client::Zip zip(largest);
    std::string noise;
    std::uint64_t state = 1;
    for (int i = 0; i < 100'000; ++i)
      noise += static_cast<char>((state *= 6364136223846793005u) >> 60);
    zip.Add("empty", "");
    zip.Add("small", "abc");
    zip.Add("noise", noise);
    zip.Add("zeros", std::string(300'000, '\0'));
    zip.Add("last", "z");
    ASSERT_TRUE(client::WriteFile(Path("a.zip"), zip.Finish()).has_value());
    std::ofstream(Path("noise"), std::ios::binary) << noise;
    EXPECT_EQ(
        InPython("import zipfile; z = zipfile.ZipFile(sys.argv[1]); "
                 "noise = open(sys.argv[1][:-5] + 'noise', 'rb').read(); "
                 "wanted = [b'', b'abc', noise, bytes(300000), b'z']; "
                 "sys.exit(z.testzip() is not None or [z.read(n) for n in z.namelist()] != wanted)",
                 Path("a.zip")),
        0)
        << largest;
  }
}

}  // namespace
}  // namespace stellate
