#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "server/rpc/server_stream.h"

namespace stellate::server {

// How long a client may leave a part of a download unread, or the end of any stream.
inline constexpr auto kUnreadPatience = std::chrono::seconds(30);

// RESOURCE_EXHAUSTED: AddWatcher refused.
grpc::Status TooManyWatchers(ServerState& state, const Session& session);

// The status of a stream that has waited for `waited` for a mesh's history from the disk.
// RESOURCE_EXHAUSTED: the server has no memory for it; INTERNAL: it cannot be read back; nothing:
// wait on.
std::optional<grpc::Status> NoHistory(ServerState& state, const Session& session,
                                      Clock::duration waited);

// One client's stream of a mesh's history: a cursor in it, and at most one message on its way. A
// client that reads slowly costs no more: the rest waits in the history. WatchMesh and DownloadMesh
// are its subclasses.
template <typename Request, typename Response>
class HistoryStream : public ServerStream<Request, Response>, public SessionWatcher {
  using Base = ServerStream<Request, Response>;

 public:
  using Base::Base;

  void OnRequest(bool ok) final {
    grpc::Status status = ok && Base::request() != nullptr ? Open(*Base::request()) : NoRequest();
    const auto lock = Base::Lock();
    if (!status.ok()) End(std::move(status));
    Base::Pump();
  }

  void Wake() final {
    const auto lock = Base::Lock();
    OnNews();
    Base::Pump();
  }

 protected:
  using Base::End;
  using Base::response;
  using Base::state;
  using typename Base::Phase;
  using typename Base::Step;

  // Chooses where to start in `session`, or returns why not. Called first, without the lock.
  virtual grpc::Status Choose(const Request& request, const Session& session) = 0;
  // The action in the log, after Choose; null: none.
  virtual const char* Action() const = 0;
  // Bytes of mesh in a message, after Choose.
  virtual std::uint64_t PartBytes() const { return server::PartBytes(*state().config()); }
  // (locked) The mesh has changed, or a second has passed.
  virtual void OnNews() {}
  // (locked) How long the client may leave a message unread. It can resume later.
  virtual Clock::duration Patience() const { return kUnreadPatience; }

  // (locked) Returns the mesh's history, which it has read from the disk if necessary. Null: not
  // read yet, or this has called End.
  const MeshHistory* OpenHistory() {
    const TimePoint now = Clock::now();
    history_ = state().store.OpenHistory(Base::session());
    if (history_ != nullptr) {
      wanted_since_.reset();
      return history_.get();
    }
    if (!wanted_since_) wanted_since_ = now;
    if (auto status = NoHistory(state(), session(), now - *wanted_since_)) End(std::move(*status));
    return nullptr;
  }
  const MeshHistory* history() const { return history_.get(); }
  void CloseHistory() { history_.reset(); }

  const Session& session() const { return *Base::session(); }

 private:
  bool IsStuck(TimePoint now) const final {
    const bool finished = Base::phase() == Phase::kFinished;
    if (Base::session() == nullptr || (!finished && Base::phase() != Phase::kWriting)) return false;
    return now - Base::last_write() > (finished ? kUnreadPatience : Patience());
  }

  void OnTick(TimePoint /*now*/) final {
    OnNews();
    Base::Pump();
  }

  void OnFinish() final { CloseHistory(); }

  grpc::Status Open(const Request& request) {
    auto session = FindMesh(state(), Base::caller(), request.name());
    if (!session) return session.error();
    if (auto status = Choose(request, **session); !status.ok()) return status;
    if (auto status = Base::Attach(*session, PartBytes()); !status.ok()) return status;
    const auto self = std::static_pointer_cast<HistoryStream>(this->shared_from_this());
    if (!(*session)->history().AddWatcher(self)) return TooManyWatchers(state(), **session);
    if (const char* const action = Action()) Audit(**session, Base::caller(), Base::peer(), action);
    return grpc::Status::OK;
  }

  std::shared_ptr<const MeshHistory> history_;  // while it is read
  std::optional<TimePoint> wanted_since_;       // the history
};

}  // namespace stellate::server
