#include "tests/fuzz/scripted_session.h"

#include <cmath>
#include <cstring>
#include <deque>
#include <limits>
#include <set>
#include <vector>

#include "tests/server/support/sphere.h"

namespace stellate::fuzz {
namespace {

using namespace std::chrono_literals;
using core::AnswerBlock;
using server::Chunk;
using server::Session;
using server::WorkerId;

constexpr std::size_t kMostWorkers = 4;

enum class Act {
  kIgnore,
  kAnswerTwice,
  kLeave,
  kLeaveAndComeBack,
  kBringAnother,
  kStolenLease,
  kStaleLease,
  kMove,
  kNotFinite,
  kWrongCount,
  kNotFound,
  kTurnTangents,
  kNoTangents,
  kFail,
  kCancel,
  kSuspend,
  kAnswerLater,
  kCount,
};

// Bytes below answer truly.
constexpr int kFirstAct = 128;
Act ActOf(int byte) { return static_cast<Act>(byte % static_cast<int>(Act::kCount)); }

class Theatre;

// What the pool sees of a worker. It may outlive the play.
class Actor : public server::OracleWorker {
 public:
  explicit Actor(Theatre* play) : play_(play) {}
  void Ask(Chunk chunk) override;
  void End(const server::WorkerEnd&) override {
    Require(!ended, "a worker is told the end once");
    ended = true;
  }
  void Forget() { play_ = nullptr; }

  WorkerId id = 0;
  bool gone = false;
  bool ended = false;

 private:
  Theatre* play_;
};

class Theatre {
 public:
  Theatre(Session* session, Script* script) : session_(session), script_(script) {}
  ~Theatre() {
    for (const auto& actor : actors_) actor->Forget();
  }

  void Join() {
    if (Present() >= kMostWorkers) return;
    auto actor = std::make_shared<Actor>(this);
    actors_.push_back(actor);
    const auto id = session_->pool().Join(actor, script_->empty() ? 0 : script_->Byte() % 32);
    Require(id.has_value() || played.cancelled, "a mesh that runs takes workers");
    if (id) {
      actor->id = *id;
    } else {
      actor->gone = true;
    }
    Pump();
  }

  void Push(Actor* actor, Chunk chunk) {
    Require(leases_.insert(chunk.lease).second, "no lease is used twice");
    Require(chunk.count > 0, "no chunk is empty");
    queue_.push_back({actor, std::move(chunk)});
    Pump();
  }

  Played played;

 private:
  struct Asked {
    Actor* actor;
    Chunk chunk;
  };

  std::size_t Present() const {
    std::size_t n = 0;
    for (const auto& actor : actors_) n += actor->gone ? 0 : 1;
    return n;
  }

  // Calls come nested out of one another; chunks are worked on one by one.
  void Pump() {
    if (pumping_) return;
    pumping_ = true;
    while (!queue_.empty()) {
      Asked asked = std::move(queue_.front());
      queue_.pop_front();
      // Join hands out chunks before it returns the worker's number.
      if (asked.actor->id == 0 && !asked.actor->gone) {
        queue_.push_back(std::move(asked));
        break;
      }
      Work(asked);
    }
    pumping_ = false;
  }

  static AnswerBlock Truth(const Chunk& chunk) {
    return server::testing::AnswerSphere(chunk.block(), chunk.first, chunk.count);
  }

  // Whether the chunk was this worker's to answer.
  bool Answer(const Asked& asked, const AnswerBlock& answer) {
    const auto claimed = session_->pool().Accept(asked.actor->id, asked.chunk.lease);
    if (!claimed || !*claimed) return false;
    const core::Status status = session_->pool().Deliver(**claimed, answer);
    if (!status.ok()) {
      Require(!played.truthful, "the truth is not refused");
      session_->pool().Fail(server::ToMeshFailure(status));
      Leave(asked.actor);
    }
    return true;
  }

  void Leave(Actor* actor) {
    actor->gone = true;
    session_->pool().Leave(actor->id);
  }

  void Work(const Asked& asked) {
    const std::uint8_t byte = script_->Byte();
    if (asked.actor->gone) {
      Require(!Answer(asked, Truth(asked.chunk)), "who has left answers nothing");
      return;
    }
    std::vector<Asked> later = std::move(later_);
    later_.clear();
    if (byte < kFirstAct) {
      Answer(asked, Truth(asked.chunk));
    } else {
      Do(ActOf(byte), asked);
    }
    for (const Asked& one : later) Answer(one, Truth(one.chunk));
  }

  void Do(Act act, const Asked& asked) {
    const Chunk& chunk = asked.chunk;
    server::OraclePool& pool = session_->pool();
    switch (act) {
      case Act::kIgnore:
        return;
      case Act::kAnswerTwice:
        Answer(asked, Truth(chunk));
        Require(!Answer(asked, Truth(chunk)), "a lease is answered once");
        return;
      case Act::kLeave:
        return Leave(asked.actor);
      case Act::kLeaveAndComeBack:
        Leave(asked.actor);
        return Join();
      case Act::kBringAnother:
        Join();
        Answer(asked, Truth(chunk));
        return;
      case Act::kStolenLease:
        for (const auto& thief : actors_) {
          if (thief->id == asked.actor->id) continue;
          const auto stolen = pool.Accept(thief->id, chunk.lease);
          Require(!stolen || !*stolen, "another's lease opens nothing");
        }
        Answer(asked, Truth(chunk));
        return;
      case Act::kStaleLease: {
        const std::uint64_t lease = script_->Number(4);
        const auto stale = pool.Accept(asked.actor->id, lease);
        Require(!stale || !*stale || leases_.contains(lease), "no lease that was never given");
        // It may have hit one of its own: then that one is claimed and stays unanswered.
        if (stale && *stale)
          Require(pool.Deliver(**stale, Truth(**stale)).ok(), "the truth is taken");
        Answer(asked, Truth(chunk));
        return;
      }
      case Act::kAnswerLater:
        later_.push_back(asked);
        return;
      case Act::kFail:
        played.truthful = false;
        return pool.Fail({server::FailureReason::kOracleFailed, "the script says so"});
      case Act::kCancel:
        played.truthful = false;
        played.cancelled = true;
        return session_->Cancel();
      case Act::kSuspend:
        played.truthful = false;
        played.cancelled = true;
        return session_->Suspend();
      default:
        return Lie(act, asked);
    }
  }

  void Lie(Act act, const Asked& asked) {
    played.truthful = false;
    AnswerBlock answer = Truth(asked.chunk);
    const Eigen::Index column = script_->Byte() % answer.points.cols();
    const Eigen::Index row = script_->Byte() % 3;
    double number = 0;
    const std::string bytes = script_->Bytes(sizeof(number));
    std::memcpy(&number, bytes.data(), bytes.size());
    switch (act) {
      case Act::kMove:
        answer.points(row, column) += number;
        break;
      case Act::kNotFinite:
        answer.points(row, column) = row == 0   ? std::numeric_limits<double>::infinity()
                                     : row == 1 ? std::nan("")
                                                : number;
        break;
      case Act::kWrongCount:
        answer.points.conservativeResize(3, column);
        break;
      case Act::kNotFound:
        answer.found[static_cast<std::size_t>(column)] = 0;
        break;
      case Act::kTurnTangents:
        if (answer.tangents.size() > 0) answer.tangents(row, column) += number;
        break;
      default:
        answer.tangents.resize(0, 0);
        break;
    }
    Answer(asked, answer);
  }

  Session* const session_;
  Script* const script_;
  std::vector<std::shared_ptr<Actor>> actors_;
  std::deque<Asked> queue_;
  std::vector<Asked> later_;
  std::set<server::LeaseId> leases_;
  bool pumping_ = false;
};

void Actor::Ask(Chunk chunk) {
  Require(!ended && play_ != nullptr, "nothing is asked after the end");
  play_->Push(this, std::move(chunk));
}

}  // namespace

server::SessionOptions SmallSphere() {
  server::SessionOptions options;
  options.request.name = "meshes/00000000000000000000000000000000";
  options.request.spec = server::testing::SphereSpec(0.8);
  options.request.spec.box_seeds = 8;
  options.request.spec.limits.max_vertices = 400;
  options.request.spec.limits.max_rounds = 60;
  options.request.timeouts.answer_limit = 2ms;
  options.request.timeouts.worker_wait = 2ms;
  options.policy.dispatch.chunk_bytes = 1 << 10;
  options.policy.execution.threads = 1;
  return options;
}

std::string GeometryOf(const Session& session) {
  const server::MeshHistory& history = *session.history().loaded();
  server::MeshHistory::Cursor cursor = history.Begin(0);
  std::string points;
  std::set<std::vector<std::uint32_t>> simplices;
  bool complete = false;
  while (!complete) {
    const server::DeltaPart part = history.Next(&cursor, 1 << 20);
    points.append(reinterpret_cast<const char*>(part.points.data()),
                  part.points.size() * sizeof(double));
    for (std::size_t i = 0; i + 3 <= part.removed.size(); i += 3) {
      simplices.erase({&part.removed[i], &part.removed[i] + 3});
    }
    for (std::size_t i = 0; i + 3 <= part.added.size(); i += 3) {
      Require(simplices.insert({&part.added[i], &part.added[i] + 3}).second, "no simplex twice");
    }
    complete = part.complete;
  }
  const core::Progress progress = session.View().progress;
  Require(points.size() == progress.vertices * 3 * sizeof(double),
          "all vertices are in the history");
  Require(simplices.size() == progress.simplices, "all simplices are in the history");
  for (const auto& row : simplices) {
    points.append(reinterpret_cast<const char*>(row.data()), row.size() * sizeof(row[0]));
  }
  return points;
}

char SuspendAct() {
  int byte = kFirstAct;
  while (ActOf(byte) != Act::kSuspend) ++byte;
  return static_cast<char>(byte);
}

Played Play(Session* session, Script* script) {
  static const bool silent = [] {
    server::StartLogging(server::LogLevel::kOff, server::LogFormat::kText);
    return true;
  }();
  static_cast<void>(silent);
  Theatre play(session, script);
  play.Join();
  session->Run();
  Require(session->HasEnded(), "a session that has run has ended");
  const server::SessionView view = session->View();
  Require(view.workers == 0, "nobody serves a mesh that is over");
  const auto late = session->pool().Join(std::make_shared<Actor>(nullptr), 0);
  Require(!late, "a mesh that is over takes no workers");
  Require((view.state == server::SessionState::kFailed) ==
              (view.failure.reason != server::FailureReason::kNone),
          "a failure has a reason, and nothing else has");
  Require(view.state != server::SessionState::kCancelled || play.played.cancelled,
          "nothing is cancelled by itself");
  return play.played;
}

}  // namespace stellate::fuzz
