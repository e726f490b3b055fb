// Files of triangles by strangers: read exactly, or refused with the place; nothing a file says
// ends the program, or fills its memory.
#include "support/triangle_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "stellate/oracles.h"
#include "support/mutator.h"

namespace stellate::oracles {
namespace {

using ::testing::HasSubstr;

class TriangleFiles : public ::testing::Test {
 protected:
  TriangleFiles() { std::filesystem::create_directories(folder_); }
  ~TriangleFiles() override { std::filesystem::remove_all(folder_); }
  std::string Written(const std::string& ending, const std::string& bytes) const {
    std::ofstream(folder_ / ("a" + ending), std::ios::binary) << bytes;
    return folder_ / ("a" + ending);
  }
  const std::filesystem::path folder_ = std::filesystem::path(::testing::TempDir()) /
                                        ("stellate-triangle-files-" + std::to_string(getpid()));
};

TEST_F(TriangleFiles, AllFormatsHoldTheSame) {
  const Eigen::MatrixXd points =
      (Eigen::MatrixXd(3, 4) << 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1, 0.125).finished();
  const Eigen::MatrixXi corners =
      (Eigen::MatrixXi(3, 4) << 0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3).finished();
  for (const testing::TriangleFile& file : testing::TetrahedronFiles()) {
    const Triangles read = ReadTriangles(Written(file.ending, file.bytes));
    EXPECT_EQ(read.points, points) << file.bytes;
    EXPECT_EQ(read.corners, corners) << file.bytes;
  }
  EXPECT_EQ(ReadTriangles(Written(".STL", testing::TetrahedronFiles()[4].bytes)).points, points);
}

TEST_F(TriangleFiles, PolygonsAreSplit) {
  const std::string square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n";
  for (const std::string& path :
       {Written(".off", "OFF 4 1 0\n" + square + "4 0 1 2 3\n"),
        Written(".ply", ply + square + "4 0 1 2 3\n"),
        Written(".obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")}) {
    EXPECT_EQ(ReadTriangles(path).corners, (Eigen::MatrixXi(3, 2) << 0, 0, 1, 2, 2, 3).finished());
  }
}

struct Damaged {
  std::string ending, bytes, words;
};
void PrintTo(const Damaged& damaged, std::ostream* out) { *out << damaged.words; }

class Refusing : public TriangleFiles, public ::testing::WithParamInterface<Damaged> {};

TEST_P(Refusing, NamesTheFileThePlaceAndTheCause) {
  const std::string path = Written(GetParam().ending, GetParam().bytes);
  try {
    TriangleMesh{path};
    FAIL() << "taken";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr("'" + path + "' cannot be read as a mesh: "));
    EXPECT_THAT(e.what(), HasSubstr(GetParam().words));
  }
}

std::string Ply(const std::string& header, const std::string& body, const char* format = "ascii") {
  return std::string("ply\nformat ") + format + " 1.0\n" + header + "end_header\n" + body;
}
const std::string kVertex =
    "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kFace = "element face 1\nproperty list char int vertex_indices\n";

std::string BinaryStl(std::uint32_t triangles, const std::string& rest) {
  std::string bytes(80, ' ');
  testing::AppendRaw(triangles, false, &bytes);
  return bytes + rest;
}

INSTANTIATE_TEST_SUITE_P(
    Damaged, Refusing,
    ::testing::Values(
        // The three that once ended a program.
        Damaged{".ply", "ply\nformat ascii 1.0\nproperty float x\nend_header\n0\n",
                "line 3: a property comes before any element"},
        Damaged{".ply", "ply\nformat ascii 1.0\nuchar vertex 76\nproperty float x\nend_header\n0\n",
                "line 3: 'uchar' is no word of a PLY's header"},
        Damaged{".off", "OFF\n1000000000 1000000000 0\n0 0 0\n",
                "line 2: says that 1000000000 points follow, and 6 bytes cannot hold them"},
        Damaged{".off", "", "ends where the word OFF should follow"},
        Damaged{".off", "OFF", "ends where how many points"},
        Damaged{".off", "4OFF 1 1 0\n", "line 1: begins with '4OFF'"},
        Damaged{".off", "OFF BINARY\n", "binary OFF is not read"},
        Damaged{".off", "OFF 8\n", "line 1: has to say how many points and how many faces"},
        Damaged{".off", "OFF -8 1 0\n", "'-8' is no such number"},
        Damaged{".off", "OFF 18446744073709551616 1 0\n", "is no such number"},
        Damaged{".off", "OFF 2 0 0\n0 0 0\n0 0x 00000\n", "line 3: '0x' is no finite number"},
        Damaged{".off", "OFF 2 0 0\n0 0 0\n0 0         \n", "line 3: a point needs 3 words"},
        Damaged{".off", "OFF 2 0 0\n0 0 0\n#              \n", "point 2 of 2 should follow"},
        Damaged{".off", "OFF 1 1 0\n0 0 1e999\n3 0 0 0\n", "line 2: '1e999' is no finite"},
        Damaged{".off", "OFF 1 1 0\n0 0 0\n3 0 0\n", "line 3: a face of 3 corners names 2"},
        Damaged{".off", "OFF 1 1 0\n0 0 0\n3 0 0 9\n", "line 3: a polygon names point 9"},
        Damaged{".off", "OFF 1 1 0\n0 0 0\n3 0 0 -1\n", "line 3: a polygon names point -1"},
        Damaged{".off", "OFF 1 1 0\n0 0 0\n3 0 0 4294967296\n", "names point 4294967296"},
        Damaged{".off", "OFF 1 1 0\n0 0 0\n2 0 0\n", "it has no triangles"},
        Damaged{".obj", "v 0 0 0\nf 1 1 2\n", "line 2: a polygon names point 1, counted from 0"},
        Damaged{".obj", "v 0 0 0\nf 1 1 0\n", "line 2: '0' names no point"},
        Damaged{".obj", "v 0 0 0\nf 1 1 -2\n", "names a point before the first"},
        Damaged{".obj", "v 0 0\n", "line 1: a point needs 4 words"},
        Damaged{".obj", "what is this\n", "it has no triangles"},
        Damaged{".stl", "", "it has 0 bytes"},
        Damaged{".stl", "solid a\nvertex 0 0 0\nendloop\n", "line 3: a triangle has 1 corners"},
        Damaged{".stl", "solid a\nfacet normal 0 0 1\n", "ends before 'endsolid'"},
        Damaged{".stl", "solid a\nhexagon\n", "line 2: 'hexagon' is no word of STL"},
        Damaged{".stl", BinaryStl(4000000000, "abc"), "4000000000 triangles follow"},
        Damaged{".stl", BinaryStl(0, ""), "it has no triangles"},
        Damaged{".stl", BinaryStl(1, std::string(50, '\xff')), "byte 96: a corner of triangle 0"},
        Damaged{".ply", "ply\nformat\n", "line 2: the second line of a PLY says its format"},
        Damaged{".ply", "ply\nformat ebcdic 1.0\n", "line 2: 'ebcdic' is none of"},
        Damaged{".ply", "ply\nformat ascii 1.0\n", "where 'end_header' should follow"},
        Damaged{".ply", Ply("element vertex 99999999999999999999\n", ""), "no such number"},
        Damaged{".ply", Ply("element nothing 18446744073709551615\n", ""), "it has no triangles"},
        Damaged{".ply", Ply(kVertex + kVertex, ""), "line 7: the name 'vertex' is there twice"},
        Damaged{".ply", Ply(kVertex + "property float x\n", ""), "the name 'x' is there twice"},
        Damaged{".ply", Ply("element vertex 1\nproperty float x\nproperty float y\n", "0 0\n"),
                "no property 'z'"},
        Damaged{".ply", Ply(kVertex + "property list float int a\n", ""),
                "has to be a whole number"},
        Damaged{".ply", Ply(kVertex + "property quad w\n", ""), "line 7: 'quad' is no type of PLY"},
        Damaged{".ply", Ply(kVertex + kFace, "0 0 0\n3 0 0\n"), "line 11: a list is 3 long"},
        Damaged{".ply", Ply(kVertex + kFace, "0 0 0\n-1 0 0\n"), "line 11: a list is -1 long"},
        Damaged{".ply", Ply(kVertex + kFace, "0 0 0\n3 0 0 1\n"),
                "face 0: a polygon names point 1"},
        Damaged{".ply",
                Ply(kVertex + "element face 1\nproperty list char float vertex_index\n",
                    "0 0 0\n3 0 0 0\n"),
                "by numbers that are not whole"},
        Damaged{".ply", Ply(kVertex + kFace, std::string(13, '\x7f'), "binary_big_endian"),
                "says that 127 numbers of a list follow, and 0 bytes cannot hold them"},
        Damaged{".ply", Ply(kVertex + kFace, std::string(13, '\xff'), "binary_little_endian"),
                "a coordinate is not finite"},
        Damaged{".ply", Ply(kVertex + kFace, "abcdefghijk", "binary_little_endian"),
                "says that 1 of 'vertex' follow"},
        Damaged{".vtu", "<VTKFile/>", "files that are read end in .off, .ply, .stl or .obj"}));

TEST_F(TriangleFiles, WhatIsNoFileIsRefused) {
  std::filesystem::create_directory(folder_ / "folder.off");
  ASSERT_EQ(mkfifo((folder_ / "pipe.off").c_str(), 0600), 0);  // opened, it would wait for ever
  for (const char* name : {"folder.off", "pipe.off"}) {
    try {
      ReadTriangles(folder_ / name);
      FAIL() << "taken";
    } catch (const std::invalid_argument& e) {
      EXPECT_THAT(e.what(), HasSubstr("it is no file"));
    }
  }
}

// This process may take so much more than now; bad_alloc else. Sanitizers take terabytes.
class MemoryBound {
 public:
  explicit MemoryBound(size_t more) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    getrlimit(RLIMIT_AS, &before_);
    size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlimit bound{pages * static_cast<size_t>(getpagesize()) + more, before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_AS, &bound), 0);
#else
    static_cast<void>(more);
#endif
  }
  ~MemoryBound() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    setrlimit(RLIMIT_AS, &before_);
#endif
  }

 private:
  rlimit before_{};
};

TEST_F(TriangleFiles, MutatedOnesAreReadOrRefusedInLittleMemory) {
  const std::vector<testing::TriangleFile> files = testing::TetrahedronFiles();
  std::vector<std::string> seeds;
  for (const testing::TriangleFile& file : files) seeds.push_back(file.bytes);
  testing::Mutator mutator(seeds, 7);
  const MemoryBound bound(16 << 20);
  int read = 0, refused = 0;
  for (int round = 0; round < 600; ++round) {
    for (const testing::TriangleFile& file : files) {
      const std::string path = Written(file.ending, mutator.Damaged(file.bytes));
      try {
        const Triangles triangles = ReadTriangles(path);
        ++read;
        // A point far away is filled up to, which is right and takes its time.
        if (triangles.points.cwiseAbs().maxCoeff() < 4) TriangleMesh(path, {0.25, {}});
      } catch (const std::invalid_argument& e) {
        ++refused;
        EXPECT_EQ(std::string(e.what()).find("memory"), std::string::npos) << e.what();
      }
    }
  }
  EXPECT_GT(read, 100);  // or no mutation went deep
  EXPECT_GT(refused, 2000);
}

}  // namespace
}  // namespace stellate::oracles
