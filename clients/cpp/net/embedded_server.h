#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <thread>

#include "stellate/error.h"

namespace stellate::client {

// The path of a stellated to start: $STELLATED, else next to the running program, else on PATH.
Expected<std::string> FindServer();

// A stellated of one's own on a unix socket in a directory that only this user may enter. It stops
// when this object goes, and is killed when the thread that started it dies.
class EmbeddedServer {
 public:
  static Expected<std::unique_ptr<EmbeddedServer>> Start();
  ~EmbeddedServer();
  EmbeddedServer(const EmbeddedServer&) = delete;
  EmbeddedServer& operator=(const EmbeddedServer&) = delete;

  const std::string& address() const { return address_; }  // "unix:/..."
  bool alive() const;                                      // from any thread

 private:
  EmbeddedServer() = default;
  Expected<void> Launch(const std::string& binary);
  Expected<void> AwaitReady();
  std::string LogTail() const;

  std::string directory_, address_;
  pid_t process_ = -1;
  int output_ = -1;    // read end of its standard output
  std::thread drain_;  // so that whatever else it prints never blocks it
};

}  // namespace stellate::client
