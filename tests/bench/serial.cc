// One mesh for callgrind, by tests/bench/serial.py:
//
//   valgrind --tool=callgrind --collect-atstart=no serial all|serial MANIFOLD EPSILON
//
// Counts what is run inside Mesher::Absorb on one thread: all of it, or what is outside of parallel
// loops. Prints the number of vertices.

#include <valgrind/callgrind.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "core/base/function_ref.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

// The linker puts Outside in the place of ParallelRanges, which all parallel loops go through
// (CMakeLists.txt: --wrap).
#define STELLATE_RANGES "_ZN8stellate4core14ParallelRangesEmNS0_11FunctionRefIFvmmEEE"
using Ranges = stellate::core::FunctionRef<void(std::size_t, std::size_t)>;
void Inside(std::size_t count, Ranges body) __asm__("__real_" STELLATE_RANGES);
void Outside(std::size_t count, Ranges body) __asm__("__wrap_" STELLATE_RANGES);

namespace {

bool counts_all = true;
int depth = 0;  // of parallel loops

}  // namespace

void Outside(std::size_t count, Ranges body) {
  const bool stops = !counts_all && depth == 0;
  if (stops) CALLGRIND_TOGGLE_COLLECT;
  ++depth;
  Inside(count, body);
  --depth;
  if (stops) CALLGRIND_TOGGLE_COLLECT;
}

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: serial all|serial MANIFOLD EPSILON\n");
    return 2;
  }
  counts_all = std::strcmp(argv[1], "serial") != 0;
  const auto manifold = stellate::testing::Make(argv[2]);
  auto spec = stellate::testing::SpecificationFor(*manifold, std::atof(argv[3]));
  const auto mesher = stellate::core::Mesher::Create(spec, {.threads = 1});
  if (!mesher) {
    std::fprintf(stderr, "serial: %s\n", mesher.error().message.c_str());
    return 2;
  }
  while (const auto batch = (*mesher)->NextBatch()) {
    const auto answers = stellate::testing::AnswersOf(*manifold, *batch);
    CALLGRIND_TOGGLE_COLLECT;
    const auto delta = (*mesher)->Absorb(answers);
    CALLGRIND_TOGGLE_COLLECT;
    if (!delta) (*mesher)->Fail(delta.error());
  }
  const auto& report = (*mesher)->report();
  std::printf("%llu\n", static_cast<unsigned long long>(report.counts.vertices));
  return report.certificate.certified ? 0 : 1;
}
