#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace stellate::server::testing {

inline void WriteFile(const std::string& path, const std::string& text) {
  std::ofstream(path + ".new") << text;
  std::filesystem::rename(path + ".new", path);
}

inline std::string ReadFile(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A directory for one test's files.
class ScratchDirectory {
 public:
  ScratchDirectory() {
    std::string pattern = ::testing::TempDir() + "stellate-XXXXXX";
    EXPECT_NE(mkdtemp(pattern.data()), nullptr);
    path_ = pattern;
  }
  ~ScratchDirectory() { std::filesystem::remove_all(path_); }
  ScratchDirectory(const ScratchDirectory&) = delete;
  ScratchDirectory& operator=(const ScratchDirectory&) = delete;
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

// A certificate authority of the moment, made by openssl. Files: NAME.pem, NAME.key.
class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name = "authority") : name_(name) {
    Run("req -x509 " + NewKey(name) + " -out " + Path(name + ".pem") + " -days 2");
  }

  // Signs a certificate for localhost and 127.0.0.1; returns the path without its ending.
  std::string Issue(const std::string& name) const {
    WriteFile(Path("names"), "subjectAltName=DNS:localhost,IP:127.0.0.1\n");
    Run("req -new " + NewKey(name) + " -out " + Path(name + ".csr"));
    Run("x509 -req -in " + Path(name + ".csr") + " -CA " + certificate() + " -CAkey " +
        Path(name_ + ".key") + " -set_serial 1 -days 2 -extfile " + Path("names") + " -out " +
        Path(name + ".pem"));
    return Path(name);
  }

  std::string certificate() const { return Path(name_ + ".pem"); }

 private:
  std::string Path(const std::string& name) const { return directory_ / name; }
  std::string NewKey(const std::string& name) const {
    return "-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=" + name + " -keyout " +
           Path(name + ".key");
  }
  static void Run(const std::string& arguments) {
    EXPECT_EQ(std::system(("openssl " + arguments + " 2>/dev/null").c_str()), 0) << arguments;
  }

  const std::string name_;
  const ScratchDirectory directory_;
};

}  // namespace stellate::server::testing
