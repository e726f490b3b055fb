// Files of points by strangers: read exactly, or refused with the line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "stellate/oracles.h"

namespace stellate::oracles {
namespace {

using ::testing::HasSubstr;

class PointFiles : public ::testing::Test {
 protected:
  PointFiles() { std::filesystem::create_directories(folder_); }
  ~PointFiles() override { std::filesystem::remove_all(folder_); }
  std::string Written(const std::string& ending, const std::string& bytes) const {
    std::ofstream(folder_ / ("a" + ending), std::ios::binary) << bytes;
    return folder_ / ("a" + ending);
  }
  std::string Refusal(const std::string& ending, const std::string& bytes) const {
    try {
      ReadPoints(Written(ending, bytes));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "it was read";
  }
  const std::filesystem::path folder_ = std::filesystem::path(::testing::TempDir()) /
                                        ("stellate-point-files-" + std::to_string(getpid()));
};

const Eigen::MatrixXd kPoints =
    (Eigen::MatrixXd(3, 3) << 1, 0.1, -7, 2.5, -1e-3, 8, 3, 4e30, 9).finished();

template <typename Number>
std::string Npy(const std::string& type, bool columns, std::endian order,
                const Eigen::MatrixXd& points) {
  std::string header = "{'descr': '" + type +
                       "', 'fortran_order': " + (columns ? "True" : "False") + ", 'shape': (" +
                       std::to_string(points.cols()) + ", " + std::to_string(points.rows()) +
                       "), }\n";
  std::string bytes =
      std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size()) + '\0' + header;
  const Eigen::MatrixXd stored = columns ? Eigen::MatrixXd(points.transpose()) : points;
  for (const double number : stored.reshaped()) {
    const auto cast = static_cast<Number>(number);
    std::string raw(reinterpret_cast<const char*>(&cast), sizeof cast);
    if (order != std::endian::native) raw = std::string(raw.rbegin(), raw.rend());
    bytes += raw;
  }
  return bytes;
}

TEST_F(PointFiles, AllFormatsHoldTheSame) {
  const std::string text = "1 2.5 3\n0.1 -1e-3 4e30\n-7 8 9\n";
  EXPECT_EQ(ReadPoints(Written(".xyz", text)), kPoints);
  EXPECT_EQ(ReadPoints(Written(".txt", "# made by hand\n\n" + text)), kPoints);
  EXPECT_EQ(ReadPoints(Written(".csv", "x,y,z\r\n1,2.5,3\r\n0.1, -1e-3,4e30\r\n-7,8,9\r\n")),
            kPoints);
  EXPECT_EQ(ReadPoints(Written(".PLY",
                               "ply\nformat ascii 1.0\nelement vertex 3\nproperty uchar red\n"
                               "property double x\nproperty double y\nproperty double z\n"
                               "element face 1\nproperty list uchar int vertex_indices\n"
                               "end_header\n9 1 2.5 3\n9 0.1 -1e-3 4e30\n9 -7 8 9\n3 0 1 2\n")),
            kPoints);
  const auto little = std::endian::little, big = std::endian::big;
  EXPECT_EQ(ReadPoints(Written(".npy", Npy<double>("<f8", false, little, kPoints))), kPoints);
  EXPECT_EQ(ReadPoints(Written(".npy", Npy<double>(">f8", true, big, kPoints))), kPoints);
  EXPECT_EQ(ReadPoints(Written(".npy", Npy<float>("<f4", false, little, kPoints))),
            kPoints.cast<float>().cast<double>());
  const Eigen::MatrixXd whole = (Eigen::MatrixXd(2, 2) << 1, -2, 3, 100).finished();
  EXPECT_EQ(ReadPoints(Written(".npy", Npy<std::int8_t>("|i1", false, little, whole))), whole);
  EXPECT_EQ(ReadPoints(Written(".npy", Npy<std::int64_t>("<i8", false, little, whole))), whole);
}

TEST_F(PointFiles, TheFirstCoordinatesAreKept) {
  const std::string file = Written(".txt", "1 2 3 0 0 1\n4 5 6 0 1 0\n");
  EXPECT_EQ(ReadPoints(file).rows(), 6);
  EXPECT_EQ(ReadPoints(file, 3), (Eigen::MatrixXd(3, 2) << 1, 4, 2, 5, 3, 6).finished());
  EXPECT_THROW(ReadPoints(file, 7), std::invalid_argument);
}

TEST_F(PointFiles, ColumnsAreKeptByTheirTitlesOrNumbers) {
  const std::vector<std::string> xyz = {"x", "y", "z"};
  const std::string scan =
      "\xef\xbb\xbftime,x,\"y\",z,what it is\r\n2026-01-01 10:00,1, 2.5,3,a wall\r\n"
      ",0.1,-1e-3,4e30,\r\n7,-7,8,9,1\r\n";
  EXPECT_EQ(ReadPoints(Written(".csv", scan), {}, xyz), kPoints);
  EXPECT_EQ(ReadPoints(Written(".csv", scan), {}, {"2", "3", "4"}), kPoints);
  EXPECT_EQ(ReadPoints(Written(".csv", scan), {}, {"z", "x"}), kPoints({2, 0}, Eigen::all));
  EXPECT_EQ(
      ReadPoints(Written(".txt", "t x y z\n0 1 2.5 3\n0 0.1 -1e-3 4e30\n0 -7 8 9\n"), {}, xyz),
      kPoints);
  EXPECT_EQ(ReadPoints(Written(".txt", "1 2.5 3\n0.1 -1e-3 4e30\n-7 8 9\n"), {}, {"3", "1"}),
            kPoints({2, 0}, Eigen::all));
  const std::string npy = Npy<double>("<f8", false, std::endian::little, kPoints);
  EXPECT_EQ(ReadPoints(Written(".npy", npy), {}, {"2"}), kPoints.row(1));
  const auto refusal = [&](const std::string& ending, const std::string& bytes,
                           const std::vector<std::string>& columns) -> std::string {
    try {
      ReadPoints(Written(ending, bytes), {}, columns);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "it was read";
  };
  EXPECT_THAT(refusal(".csv", scan, {"x", "height"}),
              HasSubstr("no column 'height': there are 5, 'time', 'x', 'y', 'z', 'what it is'"));
  EXPECT_THAT(refusal(".csv", scan, {"time"}),
              HasSubstr("line 2: '2026-01-01 10:00' is no finite"));
  EXPECT_THAT(refusal(".csv", "x,y\n1,2\n3\n", {"x"}), HasSubstr("line 3: has 1 columns"));
  EXPECT_THAT(refusal(".txt", "1 2\n", {"0"}), HasSubstr("there are 2, without titles"));
  EXPECT_THAT(refusal(".txt", "1 2\n", {"x"}), HasSubstr("no column 'x'"));
  EXPECT_THAT(refusal(".npy", npy, {"4"}), HasSubstr("there are 3, without titles"));
  EXPECT_THAT(refusal(".csv", "x,y\n", {"x"}), HasSubstr("no points"));
}

TEST_F(PointFiles, OtherColumnsThanXyzAreAskedAbout) {
  const std::string scan = "X,Y,Z,intensity\n1,2,3,4\n";
  EXPECT_THAT(Refusal(".csv", scan),
              HasSubstr("line 1: the columns are 'X', 'Y', 'Z', 'intensity': say which are "
                        "coordinates, by --columns x,y,z or so; if all are, by --ambient 4"));
  EXPECT_EQ(ReadPoints(Written(".csv", scan), 4).rows(), 4);
  EXPECT_EQ(ReadPoints(Written(".csv", "a,b,c,d\n1,2,3,4\n")).rows(), 4);
}

TEST_F(PointFiles, WhatIsWrongIsRefusedWithTheLine) {
  EXPECT_THAT(Refusal(".xyz", "1 2 3\n4 5 6\n7 8\n"),
              HasSubstr("line 3: has 2 numbers, and line 1 has 3"));
  EXPECT_THAT(Refusal(".csv", "x,y\n1,2\n3,nan\n"), HasSubstr("line 3: 'nan' is no finite number"));
  EXPECT_THAT(Refusal(".csv", "x,1\n1,2\n"), HasSubstr("line 1: 'x' is no finite number"));
  EXPECT_THAT(Refusal(".csv", "x,y\n1,2\nx,y\n"), HasSubstr("line 3: 'x' is no finite number"));
  EXPECT_THAT(Refusal(".txt", "1;2\n3;4\n"), HasSubstr("line 2: '3;4'"));
  EXPECT_THAT(Refusal(".txt", "1 1e999\n"), HasSubstr("line 1: '1e999'"));
  EXPECT_THAT(Refusal(".txt", "# nothing\n"), HasSubstr("no points"));
  EXPECT_THAT(Refusal(".las", "LASF"), HasSubstr(".ply, .npy, .csv, .xyz or .txt"));
  EXPECT_THAT(
      Refusal(".ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
              "property float z\nend_header\n0 inf 0\n"),
      HasSubstr("line 8"));
  EXPECT_THROW(ReadPoints(folder_ / "missing.txt"), std::invalid_argument);
}

// They have been read as twice as many coordinates.
TEST_F(PointFiles, DecimalCommasAreRefused) {
  for (const char* const text : {"1,5 2,5 3,5\n4,5 5,5 6,5\n", "x y\n1,5\t-2,5\n", "1,5 2 3,25\n"})
    EXPECT_THAT(Refusal(".txt", text), HasSubstr("commas inside of numbers")) << text;
  for (const char* const text : {"1,5,2\n", "1, 5, 2\n", "1 ,5 ,2\n", "1.5 2.5\n", "1,\t5\n"})
    EXPECT_EQ(Refusal(".csv", text), "it was read") << text;
}

TEST_F(PointFiles, NumpysThatAreWrongAreRefused) {
  const std::string good = Npy<double>("<f8", false, std::endian::little, kPoints);
  EXPECT_THAT(Refusal(".npy", "no numpy"), HasSubstr("does not begin"));
  EXPECT_THAT(Refusal(".npy", good.substr(0, good.size() - 1)), HasSubstr("cut short"));
  EXPECT_THAT(Refusal(".npy", good.substr(0, 9)), HasSubstr("cut short"));
  EXPECT_THAT(Refusal(".npy", good.substr(0, 40)), HasSubstr("header is cut short"));
  EXPECT_THAT(Refusal(".npy", Npy<double>("<c16", false, std::endian::little, kPoints)),
              HasSubstr("c16'"));
  Eigen::MatrixXd bad = kPoints;
  bad(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(Refusal(".npy", Npy<double>("<f8", false, std::endian::little, bad)),
              HasSubstr("coordinate 2 of row 1 is not finite"));
  // Any byte of the header may be anything.
  for (std::size_t at = 0; at < 80; ++at) {
    for (const char byte : {'\0', '\xff', '9', '(', '\''}) {
      std::string changed = good;
      changed[at] = byte;
      Refusal(".npy", changed);
    }
  }
}

}  // namespace
}  // namespace stellate::oracles
