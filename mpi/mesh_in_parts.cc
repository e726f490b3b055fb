#include "mesh_in_parts.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <optional>
#include <utility>

#include "core/base/parcel.h"
#include "core/mesher.h"
#include "mesh/piece.h"
#include "mpi_peers.h"
#include "pieces.h"
#include "result.h"
#include "run/scaled.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/session/session.h"
#include "shared_questions.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::mpi {
namespace {

using Bytes = core::Peers::Bytes;
using Clock = std::chrono::steady_clock;

// As many as ids go; the ranks are the user's own.
constexpr std::uint64_t kMostVertices = 2'000'000'000;

Expected<v1::MeshSpec> Declare(Oracle& oracle, const MeshOptions& options) {
  if (!options.epsilon.length())
    return Fail(ErrorCode::kRefused,
                "epsilon is to be chosen, which takes a server: say how large it is, as "
                "'stellate doctor' finds it");
  try {
    return client::ToSpec(oracle, options);
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kOracleFailed, error.what());
  }
}

Expected<server::MeshRequest> Read(const v1::MeshSpec& spec) {
  server::Config config;
  config.max_vertices = kMostVertices;
  config.max_coordinates = kMostVertices * core::kMaxAmbientDimension;
  auto request = server::FromProto(spec, config);
  if (request) return std::move(*request);
  return tl::unexpected(client::FromStatus(server::ToGrpc(request.error())));
}

// What all parts were asked for: they have to be given the same.
Expected<server::MeshRequest> Settle(Oracle& oracle, const MeshOptions& options,
                                     const core::Peers& peers) {
  const Expected<v1::MeshSpec> spec = Declare(oracle, options);
  Expected<server::MeshRequest> request =
      spec ? Read(*spec) : Expected<server::MeshRequest>(tl::unexpected(spec.error()));
  const Expected<void> own =
      request ? Expected<void>() : Expected<void>(tl::unexpected(request.error()));
  if (auto agreed = Agree(peers, own); !agreed) return tl::unexpected(agreed.error());
  const std::string text = spec->SerializeAsString();
  const auto bytes = std::as_bytes(std::span(text));
  const std::vector<Bytes> all = peers.ToAll({bytes.begin(), bytes.end()});
  for (std::size_t part = 1; part < all.size(); ++part)
    if (all[part] != all[0])
      return Fail(ErrorCode::kRefused, "rank " + std::to_string(part) +
                                           " has another manifold than rank 0, or other options: "
                                           "give all ranks the same");
  return request;
}

// One mesh, from its first round to its end.
class PartRun {
 public:
  // keeps_geometry: whether this part is to have the mesh's geometry in the end.
  PartRun(const server::MeshRequest& request, Oracle& oracle, const MeshOptions& options,
          const core::Peers& peers, core::Execution execution, bool keeps_geometry)
      : request_(request),
        options_(options),
        execution_(execution),
        keeps_geometry_(keeps_geometry),
        questions_(request.spec, oracle, peers, options.workers, options.max_chunk),
        peers_(peers) {}

  // The mesh as a server would say it, and its geometry where it is kept. Throws what on_progress
  // threw, once all parts have stopped.
  Expected<Result> Go() {
    auto made = core::Mesher::CreatePart(request_.spec, peers_, execution_);
    if (!made) return Fail(ErrorCode::kRefused, made.error().message);
    core::Mesher& mesher = **made;
    while (const auto batch = mesher.NextBatch()) {
      if (IsToStop())
        mesher.Cancel();
      else
        Round(mesher, batch);
    }
    if (thrown_) std::rethrow_exception(thrown_);
    server::SessionView view = ViewOf(mesher);
    view.report = mesher.report();
    view.state = StateOf(&view);
    Result result;
    server::ToProto(request_, view, &result.mesh);
    if (view.state == server::SessionState::kFailed)
      return tl::unexpected(client::WhyFailed(result.mesh));
    if (keeps_geometry_) result.history = HistoryOf(mesher, execution_, std::move(walls_));
    return result;
  }

 private:
  // Whether any part wants it to.
  bool IsToStop() const {
    return peers_.Sum(thrown_ || options_.stop.stop_requested() ? 1 : 0).all > 0;
  }

  void Round(core::Mesher& mesher, const std::shared_ptr<const core::QueryBatch>& batch) {
    SharedQuestions::Outcome outcome = questions_.Ask(batch);
    if (outcome.failure) return Stop(mesher, std::move(*outcome.failure));
    const core::Expected<core::MeshDelta> delta = mesher.Absorb(outcome.answers);
    if (!delta) return Stop(mesher, server::ToMeshFailure(delta.error()));
    NoteWalls(*delta);
    if (!options_.on_progress) return;
    v1::Progress progress;
    server::ToProto(ViewOf(mesher), &progress);
    try {
      options_.on_progress(client::FromProto(progress));
    } catch (...) {
      thrown_ = std::current_exception();  // others would wait for this part
    }
  }

  void Stop(core::Mesher& mesher, server::MeshFailure failure) {
    mesher.Fail({core::StatusCode::kOracleFailed, failure.message});
    failure_ = std::move(failure);
  }

  void NoteWalls(const core::MeshDelta& delta) {
    if (!keeps_geometry_ || delta.walls.empty()) return;
    walls_.resize(delta.first_vertex);
    walls_.insert(walls_.end(), delta.walls.begin(), delta.walls.end());
  }

  server::SessionView ViewOf(const core::Mesher& mesher) const {
    server::SessionView view;
    view.progress = mesher.progress();
    view.elapsed_seconds = std::chrono::duration<double>(Clock::now() - begun_).count();
    if (const double done = view.progress.fraction; view.progress.is_foreseeable && done > 0)
      view.remaining_seconds = view.elapsed_seconds * (1 - done) / done;
    return view;
  }

  server::SessionState StateOf(server::SessionView* view) const {
    view->failure = failure_;
    switch (view->report->termination) {
      case core::Termination::kConverged:
        return server::SessionState::kSucceeded;
      case core::Termination::kOracleFailed:
        if (failure_.reason == server::FailureReason::kNone)
          view->failure = server::ToMeshFailure(view->report->failure);
        return server::SessionState::kFailed;
      default:
        return server::SessionState::kStopped;
    }
  }

  const server::MeshRequest& request_;
  const MeshOptions& options_;
  const core::Execution execution_;
  const bool keeps_geometry_;
  const SharedQuestions questions_;
  const core::Peers& peers_;
  const Clock::time_point begun_ = Clock::now();
  std::vector<core::WallSet> walls_;  // of the vertices, where they are kept; none: none has any
  server::MeshFailure failure_;
  std::exception_ptr thrown_;  // by on_progress
};

// Of those that the part is to write: pieces are every part's, other files the first's.
Expected<void> CheckPaths(const Oracle& oracle, const std::vector<std::string>& paths,
                          const MeshOptions& options, int part) {
  const int k = oracle.dimension() - (options.boundary_only.value_or(false) ? 1 : 0);
  const int d = oracle.ambient_dimension();
  for (const std::string& path : paths) {
    Expected<void> ok;
    if (client::PiecePaths::AreMeantBy(path))
      ok = client::PiecePaths(path).Check(k, d, static_cast<std::size_t>(part));
    else if (part == 0)
      ok = CheckSave(path, k, d);
    if (!ok) return ok;
  }
  return {};
}

// Before any call that waits for other ranks.
Expected<void> CheckMpi() {
  int is_initialized = 0, level = MPI_THREAD_SINGLE;
  MPI_Initialized(&is_initialized);
  if (is_initialized) MPI_Query_thread(&level);
  if (level >= MPI_THREAD_SERIALIZED) return {};
  return Fail(ErrorCode::kRefused,
              "the mesher's threads call MPI one at a time: begin with MPI_Init_thread and "
              "MPI_THREAD_SERIALIZED");
}

enum class Keep { kInAll, kInFirst };

// A mesh from its declaration to its end, in all ranks.
Expected<Result> Run(const Expected<std::shared_ptr<Oracle>>& made,
                     const std::vector<std::string>& paths, const MeshOptions& options, Keep keep,
                     const MpiPeers& peers, MPI_Comm comm) {
  const bool is_first = peers.part() == 0;
  const auto has_oracle = made ? Expected<void>() : tl::unexpected(made.error());
  if (auto agreed = Agree(peers, has_oracle); !agreed) return tl::unexpected(agreed.error());
  Oracle& oracle = **made;
  const auto writable = CheckPaths(oracle, paths, options, peers.part());
  if (auto agreed = Agree(peers, writable); !agreed) return tl::unexpected(agreed.error());
  Expected<server::MeshRequest> request = Settle(oracle, options, peers);
  if (!request) return tl::unexpected(request.error());
  return PartRun(*request, oracle, options, peers, {.threads = ThreadsOfEach(comm)},
                 is_first || keep == Keep::kInAll)
      .Go();
}

// The errors, the same in all parts, of those indices whose pieces could not be written.
Expected<std::vector<Error>> SaveAllPieces(const Result& result,
                                           const std::vector<std::string>& indices,
                                           const core::Peers& peers) {
  std::vector<Error> failures;
  if (indices.empty()) return failures;
  const Expected<Mesh> mesh = WholeOf(result);
  const auto own = mesh ? Expected<void>() : tl::unexpected(mesh.error());
  if (auto agreed = Agree(peers, own); !agreed) return tl::unexpected(agreed.error());
  for (const std::string& index : indices)
    if (const auto saved = SavePieces(*mesh, index, peers); !saved)
      failures.push_back(saved.error());
  return failures;
}

Expected<SavedMesh> RunTo(const Expected<std::shared_ptr<Oracle>>& made,
                          const std::vector<std::string>& paths, const MeshOptions& options,
                          MPI_Comm comm) {
  const MpiPeers peers(comm);
  std::vector<std::string> indices, files;
  for (const std::string& path : paths)
    (client::PiecePaths::AreMeantBy(path) ? indices : files).push_back(path);
  const Keep keep = indices.empty() ? Keep::kInFirst : Keep::kInAll;
  const Expected<Result> result = Run(made, paths, options, keep, peers, comm);
  if (!result) return tl::unexpected(result.error());
  const Expected<std::vector<Error>> unwritten = SaveAllPieces(*result, indices, peers);
  if (!unwritten) return tl::unexpected(unwritten.error());
  SavedMesh saved = Unsaved(*result);
  saved.failures = peers.part() == 0 ? Save(*result, files) : std::vector<Error>();
  saved.failures.insert(saved.failures.end(), unwritten->begin(), unwritten->end());
  const bool is_lost = !paths.empty() && saved.failures.size() == paths.size();
  const auto own = is_lost ? tl::unexpected(saved.failures.front()) : Expected<void>();
  if (auto agreed = Agree(peers, own); !agreed) return tl::unexpected(agreed.error());
  return saved;
}

}  // namespace

Expected<SavedMesh> MeshInPartsTo(const Expected<std::unique_ptr<Oracle>>& made,
                                  const std::vector<std::string>& paths, const MeshOptions& options,
                                  MPI_Comm comm) {
  if (!made) return RunTo(tl::unexpected(made.error()), paths, options, comm);
  return RunTo(client::Scaled(**made, options), paths, options, comm);
}

}  // namespace stellate::mpi

namespace stellate {

Expected<Mesh> MeshInParts(Oracle& oracle, const MeshOptions& options, MPI_Comm comm) {
  if (auto ok = mpi::CheckMpi(); !ok) return tl::unexpected(ok.error());
  const mpi::MpiPeers peers(comm);
  const auto scaled = client::Scaled(oracle, options);
  Expected<mpi::Result> result = mpi::Run(scaled, {}, options, mpi::Keep::kInAll, peers, comm);
  if (!result) return tl::unexpected(result.error());
  return mpi::WholeOf(*result);
}

Expected<SavedMesh> MeshInPartsTo(Oracle& oracle, const std::vector<std::string>& paths,
                                  const MeshOptions& options, MPI_Comm comm) {
  if (auto ok = mpi::CheckMpi(); !ok) return tl::unexpected(ok.error());
  return mpi::RunTo(client::Scaled(oracle, options), paths, options, comm);
}

}  // namespace stellate
