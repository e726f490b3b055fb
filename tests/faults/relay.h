#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace stellate::server::testing {

// A link between unix sockets that can be bad: connections to `from` are carried on to `to`.
class Relay {
 public:
  // Paths of sockets.
  Relay(std::string from, std::string to);
  ~Relay();

  // Breaks every connection; new ones are taken.
  void Cut();
  // While held, nothing is carried and nobody is told.
  void Hold(bool hold) { held_ = hold; }

 private:
  struct Pair {
    int client = -1, server = -1;
  };
  void Carry();
  void Accept();
  // False: one side has hung up.
  static bool Pass(int from, int to);
  static void Close(Pair* pair);

  const std::string from_, to_;
  int listener_ = -1;
  std::atomic<bool> held_{false}, stopping_{false};
  std::mutex mutex_;
  std::vector<Pair> pairs_;
  std::thread thread_;
};

}  // namespace stellate::server::testing
