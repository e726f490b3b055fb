// fault_worker ADDRESS MESH: a worker in a process of its own, so that it can be frozen.

#include "tests/faults/persistent_worker.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  stellate::server::testing::PersistentWorker(argv[1], argv[2]).Wait();
  return 0;
}
