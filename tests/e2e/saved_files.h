#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "stellate/mesh.h"

namespace stellate::testing {

inline std::string ReadFile(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline std::string SavedAs(const std::string& path, const Mesh& mesh) {
  EXPECT_TRUE(mesh.Save(path).has_value()) << path;
  return ReadFile(path);
}

}  // namespace stellate::testing
