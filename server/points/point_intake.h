#pragma once

#include <Eigen/Core>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "core/batch.h"
#include "core/reconstruction.h"
#include "core/report.h"
#include "server/base/clock.h"
#include "server/base/failure.h"
#include "server/history/mesh_history.h"
#include "server/points/points_request.h"
#include "server/points/sha256.h"

namespace stellate::server {

// A client's upload, as the intake sees it. The intake calls it from any thread, without holding
// its lock; the calls must not block. End is the last call.
class PointStream {
 public:
  virtual ~PointStream() = default;
  virtual void Proceed() = 0;                       // what it offered is taken: the next may come
  virtual void End(const core::Status& blame) = 0;  // Ok: the points are complete
};

// Consecutive rows of the points. A column each, as core::PointCloud has them.
struct PointsPart {
  std::uint64_t first_row = 0;
  Eigen::MatrixXd points;
  Eigen::MatrixXd tangents;  // empty, where none were declared
};

// SHA-256 of the whole arrays.
struct PointDigests {
  std::string points;
  std::string tangents;  // empty, where none were declared
};

// The points of one mesh, on their way from its client to its run (PointRounds). The session's
// thread asks for a round of them and waits; the client's stream offers them, and is made to wait
// while there is no room for more: it holds a round and one message at most.
//
//   intake.Join(stream);                              // then waits for stream->Proceed()
//   intake.Offer(stream.get(), part);                 // again
//   intake.OfferEnd(stream.get(), digests);           // then waits for stream->End()
//   while (auto batch = rounds.NextBatch()) {         // the session's thread
//     auto outcome = intake.Ask(*batch);              // recorded, and then:
//     intake.Note(*outcome.answers);
//   }
class PointIntake {
 public:
  // `patience`: how long Ask waits without a stream.
  PointIntake(const PointsRequest& request, Clock::duration patience);

  // Gives the mesh's upload to this stream, and ends one of before. It may
  // proceed once the mesh's replay is over. kFailedPrecondition: the mesh is over.
  core::Status Join(std::shared_ptr<PointStream> stream);
  void Leave(const PointStream* stream);

  // Checks a part and takes it. kInvalidArgument, naming the row, and nothing is taken: it does not
  // follow the rows before, is of another shape, has more rows than were declared, or numbers that
  // are not finite, or tangents that are not orthonormal. The first part of a stream may begin
  // before the row that is due: what is known is not taken again. The stream may offer the next
  // after Proceed, which may come before this returns.
  core::Status Offer(const PointStream* stream, PointsPart part);
  // kInvalidArgument: points are missing. Else End follows.
  core::Status OfferEnd(const PointStream* stream, PointDigests digests);

  // Returns the rows that a batch asks for; of one that asks for none, nothing, once the client has
  // ended the points and their digests are right. Session's thread only.
  struct Outcome {
    std::optional<core::Answers> answers;
    std::optional<MeshFailure> failure;  // neither: interrupted
  };
  Outcome Ask(const core::QueryBatch& batch);
  // These are recorded, now or by an earlier server.
  void Note(const core::Answers& answers);
  // Makes Ask return, and all later calls of it.
  void Interrupt();
  // The mesh is over: ends the stream.
  void Close(const core::Status& blame);

  std::uint64_t rows() const;  // recorded
  bool is_complete() const;    // all of them are, and the end
  bool is_joined() const;      // by a stream

  // How far the run is that follows the upload; and what it has found of the points, for the
  // session's thread alone, to be shown with its last revision.
  core::ReconstructionWatch& watch() { return watch_; }
  PointPlaces& places() { return places_; }
  // Writes that into the progress of the mesh.
  void Show(core::Progress* progress) const;

 private:
  core::Status Check(const PointsPart& part) const;
  void Begin();
  std::optional<MeshFailure> WaitLocked(std::unique_lock<std::mutex>& lock);
  std::shared_ptr<PointStream> TakeSome(core::AnswerBlock* block, Eigen::Index* filled);
  std::optional<std::string> WrongDigestLocked(const PointDigests& digests) const;

  const PointsRequest request_;
  const Clock::duration patience_;
  core::ReconstructionWatch watch_;
  PointPlaces places_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<PointStream> stream_;  // null: none
  TimePoint alone_since_;                // while it is null
  std::optional<std::uint64_t> next_;    // the row that this stream has to go on with
  std::uint64_t due_ = 0;                // the row that is to be offered next
  std::uint64_t asked_ = 0;              // rows before are recorded, or are being recorded
  std::uint64_t recorded_ = 0;
  std::optional<PointsPart> part_;          // offered
  Eigen::Index taken_ = 0;                  // of its rows
  std::optional<PointDigests> end_;         // offered
  Sha256 points_digest_, tangents_digest_;  // of the recorded rows
  enum class State { kReplaying, kTaking, kComplete, kOver } state_ = State::kReplaying;
};

}  // namespace stellate::server
