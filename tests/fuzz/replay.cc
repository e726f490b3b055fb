// Drives a target without libFuzzer: its seeds, then mutations of them that follow from a number.
//
//   TARGET [--runs N] [--seconds S] [--seed N]    mutations, by number or by time
//   TARGET FILE...                                these inputs, e.g. one that libFuzzer kept

#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>

#include "tests/fuzz/target.h"
#include "tests/support/mutator.h"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv);

namespace {

using stellate::fuzz::Seeds;
using Clock = std::chrono::steady_clock;

void Run(const std::string& input) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
}

int RunFiles(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    std::ifstream file(argv[i], std::ios::binary);
    if (!file) {
      std::fprintf(stderr, "cannot read %s\n", argv[i]);
      return 1;
    }
    Run({std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()});
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  LLVMFuzzerInitialize(&argc, &argv);
  if (argc > 1 && std::strncmp(argv[1], "--", 2) != 0) return RunFiles(argc, argv);
  long runs = 1000;
  double seconds = 0;
  unsigned seed = 1;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--runs") == 0) runs = std::atol(argv[i + 1]);
    if (std::strcmp(argv[i], "--seconds") == 0) seconds = std::atof(argv[i + 1]);
    if (std::strcmp(argv[i], "--seed") == 0) seed = static_cast<unsigned>(std::atol(argv[i + 1]));
  }
  const std::vector<std::string> seeds = Seeds();
  for (const std::string& input : seeds) Run(input);
  stellate::testing::Mutator mutator(seeds, seed);
  const auto begin = Clock::now();
  const auto more = [&](long done) {
    if (seconds > 0) return Clock::now() - begin < std::chrono::duration<double>(seconds);
    return done < runs;
  };
  long done = 0;
  while (more(done)) {
    Run(mutator.Next());
    ++done;
  }
  std::printf("%zu seeds and %ld mutations of them\n", seeds.size(), done);
  return 0;
}
