#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/security/credentials.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/auth/auth.h"
#include "server/base/clock.h"
#include "server/storage/records.h"

namespace stellate::server {

struct ServerState;

// Where a call goes.
struct Route {
  enum class Kind {
    kHere,    // also where no server has the mesh
    kThere,   // to another server, by `channel`
    kNotNow,  // the mesh is on its way from one server to another, or this one stops
  } kind = Kind::kHere;
  std::int64_t server = 0;
  std::shared_ptr<grpc::Channel> channel;  // counted as busy while it is held
};

// Leads calls to the server that has their mesh, where several share the records, and takes up
// meshes whose servers are gone. Its thread waits for the database; calls do not, but are kept
// until it has answered. Without such records all calls stay here.
class Router {
 public:
  explicit Router(ServerState* state) : state_(*state) {}
  ~Router();

  // Once the journal is open, and before the first call. `credentials`: for calls to others.
  void Start(std::shared_ptr<grpc::ChannelCredentials> credentials);
  // Once this listens: where others reach it.
  void Announce(const std::string& address);
  // Ends calls that are kept, and all further ones, as UNAVAILABLE.
  void Refuse();
  // REQUIRES: the journal waits for nothing any more.
  void Join();

  // Calls `then` with the route to a mesh: immediately where this server has it, or else on the
  // thread. A call for a mesh that goes from one server to another is kept until it is there, some
  // seconds at most. `is_passed_on`: by another server, so that it must not be once more.
  using Then = std::function<void(Route)>;
  void Find(const std::string& mesh, bool is_passed_on, Then then);
  // The same for a page of ListMeshes: pages go from server to server.
  void FindPage(const std::string& token, bool is_passed_on, Then then);

  // Tells the server at the route's end who the caller is, and hands on the call's trace and
  // deadline.
  void Introduce(const Route& route, const Identity& caller, const std::string& address,
                 const grpc::ServerContextBase& call, grpc::ClientContext* passed_on) const;

  // Of something that no record has, and that others must find here. Empty: any name does.
  std::string NewName() const;
  // A token of ListMeshes: the server whose turn it is, and its own token.
  struct PageToken {
    std::int64_t server = 0;
    std::string rest;
  };
  static PageToken ReadPageToken(const std::string& token);
  // This server's number, and that of the next in turn; 0: none.
  std::int64_t number() const;
  std::int64_t NumberAfter(std::int64_t number) const;

 private:
  struct Asked {
    std::function<Route()> resolve;
    Then then;
    TimePoint since = Clock::now(), next = since;  // not before
  };
  // Connections to a server. One carries so many calls; more would wait in it, unseen.
  struct Line {
    std::string address;
    struct Wire;
    std::vector<std::shared_ptr<Wire>> wires;
  };

  void Run(const std::stop_token& stop);
  // Resolves on the thread, or not at all if no more may be asked.
  void Ask(std::function<Route()> resolve, Then then);
  std::shared_ptr<Asked> FirstDue() const;  // (locked)
  void Tend(const std::string& mesh);
  Route Resolve(const std::string& mesh, bool is_passed_on);
  Route ResolvePage(const std::string& token, bool is_passed_on) const;
  Route To(const Peer& peer) const;
  std::int64_t BeatOf(std::int64_t number) const;  // as this server has last seen it
  bool IsHere(const std::string& mesh) const;

  ServerState& state_;
  Sharing* sharing_ = nullptr;  // null: all calls stay here
  std::shared_ptr<grpc::ChannelCredentials> credentials_;

  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::list<std::shared_ptr<Asked>> asked_;
  bool refuses_ = false;

  mutable std::mutex lines_mutex_;
  std::string address_;                         // of this server
  mutable std::map<std::int64_t, Line> lines_;  // by server

  std::jthread thread_;
};

}  // namespace stellate::server
