#pragma once

#include <string>
#include <vector>

namespace stellate::bench {

struct Work {
  std::string manifold;  // of the catalogue
  double epsilon = 0;
};

// Register benchmarks of whole meshes, and of queries shared out among workers: of `asked`, or of
// their own tables where that is empty.
void RegisterMeshes(const std::vector<Work>& asked);
void RegisterChunks(const std::vector<Work>& asked);

// Whether all meshes that were timed are certified, and the same for any number of threads.
bool AllMeshesAreRight();

}  // namespace stellate::bench
