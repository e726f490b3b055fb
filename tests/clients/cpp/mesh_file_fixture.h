#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Core>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "stellate/mesh.h"

namespace stellate {

// Saves meshes into a directory of each test's own.
class MeshFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const ::testing::TestInfo* info = ::testing::UnitTest::GetInstance()->current_test_info();
    directory_ = std::filesystem::temp_directory_path() /
                 ("stellate-mesh-file-" + std::to_string(getpid()) + "-" + info->name());
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::string Path(const std::string& name) const { return (directory_ / name).string(); }
  std::string Saved(const Mesh& mesh, const std::string& name) {
    const Expected<void> saved = mesh.Save(Path(name));
    EXPECT_TRUE(saved.has_value()) << saved.error().message;
    std::ifstream file(Path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  std::string Refusal(const Mesh& mesh, const std::string& name) {
    const Expected<void> saved = mesh.Save(Path(name));
    EXPECT_FALSE(saved.has_value());
    EXPECT_FALSE(std::filesystem::exists(Path(name)));
    if (saved) return "";
    EXPECT_EQ(saved.error().code, ErrorCode::kFileFailed);
    return saved.error().message;
  }

  std::filesystem::path directory_;
};

// The exit status of a line of Python with that argument.
inline int InPython(const std::string& line, const std::string& argument) {
  const std::string command =
      "/usr/bin/python3 -B -c \"import sys; " + line + "\" '" + argument + "'";
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// A tetrahedron's boundary in R^d, with numbers that do not fit into few digits.
inline Mesh Surface(int d) {
  Mesh mesh;
  mesh.points = Eigen::MatrixXd::Zero(d, 4);
  mesh.points(0, 1) = 1.0 / 3;
  mesh.points(1, 2) = -1e-300;
  mesh.points(d - 1, 3) = 12345678.9;
  mesh.simplices.resize(3, 4);
  mesh.simplices << 0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3;
  return mesh;
}

// The faces of an oriented closed surface pass each edge once in each direction.
inline void ExpectEdgesCancel(const std::vector<std::vector<int>>& faces) {
  std::map<std::pair<int, int>, int> passed;
  for (const std::vector<int>& face : faces) {
    ASSERT_EQ(face.size(), 3u);
    for (size_t i = 0; i < 3; ++i) ++passed[{face[i], face[(i + 1) % 3]}];
  }
  for (const auto& [edge, count] : passed) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ((passed.count({edge.second, edge.first})), 1u);
  }
}

}  // namespace stellate
