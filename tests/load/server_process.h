#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace stellate::load {

// A stellated on a free port of this machine, with what it takes of it. Killed when this goes.
class ServerProcess {
 public:
  // `durable`: with a data directory of its own, which goes with it.
  explicit ServerProcess(const std::vector<std::string>& flags = {}, bool durable = false);
  ~ServerProcess();
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;

  const std::string& address() const { return address_; }

  struct Usage {
    double resident_mb = 0, peak_mb = 0;
    double processor_seconds = 0;
    int threads = 0;
  };
  // Zeros once it is gone.
  Usage usage() const;
  // SIGTERM; its exit status.
  int Stop();

 private:
  pid_t pid_ = 0;
  std::string directory_, address_;
};

// Ends the program with what is wrong.
[[noreturn]] void Die(const std::string& message);

}  // namespace stellate::load
