#pragma once

#include <cstdint>

namespace stellate::bench {

// Processor time and memory of this process between Start and Stop, once.
//
// Processor time is that of all threads, so that what else the machine does hardly matters. Memory
// is the peak of resident memory over what was resident at Start: the mark of the kernel is reset
// there, since ru_maxrss would remember the parent of the process and its own preparations.
class Meter {
 public:
  void Start();
  void Stop();

  double seconds() const { return seconds_; }
  std::int64_t peak_bytes() const { return peak_bytes_; }

 private:
  double seconds_ = 0;
  std::int64_t peak_bytes_ = 0;
};

// Processor time of this process so far.
double ProcessorSeconds();

}  // namespace stellate::bench
