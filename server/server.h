#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/status.h"
#include "server/base/clock.h"
#include "server/config/config.h"
#include "server/session/session.h"

namespace stellate::server {

// A running server. Several may live in one process, each with its own address.
class Server {
 public:
  // Listens once this returns. Where the database does not answer yet, this waits for it, and asks
  // `give_up` now and then. kInvalidArgument: the configuration; kFailedPrecondition: the address
  // is taken or cannot be bound, or the record cannot be opened; kCancelled: it gave up.
  static core::Expected<std::unique_ptr<Server>> Start(
      const Config& config, Session::MesherFactory factory = core::Mesher::Create,
      const std::function<bool()>& give_up = [] { return false; });
  ~Server();

  // What clients dial: "127.0.0.1:7717", "unix:/path".
  const std::string& address() const { return address_; }
  // Where Prometheus is answered; 0: nowhere.
  int metrics_port() const;

  // Reads the token file, and those of TLS, again, as happens by itself within seconds of a change.
  void ReloadFiles();
  // Takes over from `next` the settings that may change while a server runs, for calls and meshes
  // from now on, and logs them; Setting::live says which. Of the others it logs that they wait for
  // the next start. kInvalidArgument, with nothing changed: `next` makes no sense. On one thread at
  // a time.
  core::Status Reload(const Config& next);
  // What is in force.
  std::shared_ptr<const Config> config() const;

  // Stops: no new meshes, then up to `drain` for running ones to end, as long as any of them has a
  // worker; then the rest is suspended, where there is a journal, or cancelled, and every stream
  // ends with UNAVAILABLE. `hurry` is asked now and then; true ends the drain.
  // False: a mesh is still computing, and the process should exit without waiting for it.
  bool Stop(
      Clock::duration drain, const std::function<bool()>& hurry = [] { return false; });

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl, std::string address);

  std::unique_ptr<Impl> impl_;
  std::string address_;
};

}  // namespace stellate::server
