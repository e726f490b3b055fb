// What a server bears. Prints figures, and fails when a mesh comes out wrong or memory grows.
//
//   load many [MESHES]        that many at once (100), two workers and two watchers each
//   load idle [MESHES]        that many without a worker (1000)
//   load soak [SECONDS]       meshes without end (600), and where memory goes
//   load cancel [CANCELS] [durable]
//                             meshes cancelled so often (100), those of more vertices less often;
//                             durable: on servers with a data directory
//   load overhead [EPSILON]   the same mesh in this process, over loopback, and from numpy

#include "tests/load/load.h"

#include <cstring>
#include <iostream>

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  const double number = argc > 2 ? std::atof(argv[2]) : 0;
  if (what == "many") return stellate::load::Many(number > 0 ? static_cast<int>(number) : 100);
  if (what == "idle") return stellate::load::Idle(number > 0 ? static_cast<int>(number) : 1000);
  if (what == "soak") return stellate::load::Soak(number > 0 ? number : 600);
  if (what == "cancel") {
    const bool durable = argc > 3 && std::strcmp(argv[3], "durable") == 0;
    return stellate::load::Cancel(number > 0 ? static_cast<int>(number) : 100, durable);
  }
  if (what == "overhead") return stellate::load::Overhead(number > 0 ? number : 0.02);
  std::cerr << "usage: load many|idle|soak|cancel|overhead [NUMBER] [durable]\n";
  return 2;
}
