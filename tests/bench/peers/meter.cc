#include "tests/bench/peers/meter.h"

#include <malloc.h>

#include <ctime>
#include <fstream>
#include <stdexcept>
#include <string>

namespace stellate::bench {
namespace {

// A line "field:  1234 kB" of the kernel's description of this process, in bytes.
std::int64_t MemoryField(const std::string& field) {
  std::ifstream status("/proc/self/status");
  std::string line;
  while (std::getline(status, line)) {
    if (line.rfind(field + ":", 0) == 0) return 1024 * std::stoll(line.substr(field.size() + 1));
  }
  throw std::runtime_error("/proc/self/status has no " + field);
}

}  // namespace

double ProcessorSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void Meter::Start() {
  malloc_trim(0);
  std::ofstream reset("/proc/self/clear_refs");
  if (!(reset << "5" << std::flush)) {
    throw std::runtime_error("cannot reset the peak of memory through /proc/self/clear_refs");
  }
  peak_bytes_ = -MemoryField("VmRSS");
  seconds_ = -ProcessorSeconds();
}

void Meter::Stop() {
  seconds_ += ProcessorSeconds();
  peak_bytes_ += MemoryField("VmHWM");
}

}  // namespace stellate::bench
