#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "tests/support/make_manifold.h"

namespace stellate::load {

// Each returns the program's exit status.
int Many(int meshes);
int Idle(int meshes);
int Soak(double seconds);
int Overhead(double epsilon);
int Cancel(int cancels, bool durable);  // durable: by servers with a data directory

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

using testing::Make;
// Ends the program if there is none.
Mesh MeshOn(const std::string& server, const std::string& manifold, double epsilon, int workers);
bool AreIdentical(const Mesh& a, const Mesh& b);

}  // namespace stellate::load
