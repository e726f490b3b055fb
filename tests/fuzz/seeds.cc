// A target called as `TARGET --write-seeds DIRECTORY` writes its seeds there and does nothing else.

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc != 3 || std::strcmp((*argv)[1], "--write-seeds") != 0) return 0;
  const std::filesystem::path directory = (*argv)[2];
  std::filesystem::create_directories(directory);
  int number = 0;
  for (const std::string& seed : stellate::fuzz::Seeds()) {
    std::ofstream file(directory / ("seed-" + std::to_string(number++)), std::ios::binary);
    file.write(seed.data(), static_cast<std::streamsize>(seed.size()));
    if (!file.flush()) {
      std::fprintf(stderr, "cannot write to %s\n", directory.c_str());
      std::exit(1);
    }
  }
  std::printf("%d seeds\n", number);
  std::exit(0);
}
