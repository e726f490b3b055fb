#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace stellate::server {

// Limits how many lines each of several parties may write: `burst` immediately, and `per_second` in
// the long run. A party that was silent until its whole burst is available again costs no memory.
// Any thread.
class LineRation {
 public:
  using Time = std::chrono::steady_clock::time_point;

  LineRation(int burst, double per_second) : burst_(burst), per_second_(per_second) {}

  // Whether `party` may write a line now; if not, the line is counted.
  bool Take(const std::string& party, Time now);
  // Who could not write, and how many lines, since this was last asked. To be called now and then.
  std::vector<std::pair<std::string, std::uint64_t>> TakeLeftOut(Time now);

 private:
  struct Party {
    double lines = 0;  // that it may write, at `at`
    Time at;
    std::uint64_t left_out = 0;
  };
  void Refill(Party* party, Time now) const;

  const double burst_, per_second_;
  std::mutex mutex_;
  std::map<std::string, Party> parties_;
};

}  // namespace stellate::server
