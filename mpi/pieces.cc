#include "pieces.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "core/base/parcel.h"
#include "core/parts/boxes.h"
#include "mesh/groups.h"
#include "mesh/piece.h"
#include "mesh/write_file.h"

namespace stellate::mpi {
namespace {

using client::Draft;
using client::PiecePaths;

// Which vertices lie in the part's box.
std::vector<bool> OwnedBy(const core::Peers& peers, const Mesh& mesh) {
  const auto n = static_cast<std::size_t>(mesh.points.cols());
  const auto d = static_cast<std::size_t>(mesh.points.rows());
  const core::Boxes boxes(std::span(mesh.points.data(), n * d), static_cast<int>(d), peers.parts());
  std::vector<bool> owned(n);
  for (std::size_t i = 0; i < n; ++i)
    owned[i] = boxes.OwnerOf(mesh.points.data() + i * d) == peers.part();
  return owned;
}

// A part's piece, and in the first part the index, on their way.
class PieceFiles {
 public:
  PieceFiles(const std::string& index, const core::Peers& peers)
      : paths_(index), peers_(peers), number_(static_cast<std::size_t>(peers.part())) {}

  Expected<void> Go(const Mesh& mesh) {
    auto done = Agree(peers_, Write(mesh));
    if (done) done = Agree(peers_, DropOldIndex());
    if (done) done = Agree(peers_, Place());
    if (done) done = Agree(peers_, PlaceIndex());
    if (!done) Drop();
    return done;
  }

 private:
  bool is_first() const { return peers_.part() == 0; }

  // All that can fail for want of space, into files that have no names yet.
  Expected<void> Write(const Mesh& mesh) {
    const Expected<bool> made = paths_.MakeFolder();
    if (!made) return tl::unexpected(made.error());
    has_made_folder_ = *made;
    const std::vector<client::Group> groups = client::GroupsOf(mesh);
    Expected<Draft> piece = Draft::Begin(paths_.Piece(number_)).and_then([&](Draft&& draft) {
      return client::WritePiece(std::move(draft), mesh, groups, OwnedBy(peers_, mesh));
    });
    if (!piece) return tl::unexpected(piece.error());
    piece_.emplace(std::move(*piece));
    if (!is_first()) return {};
    Expected<Draft> index = Draft::Begin(paths_.index());
    if (!index) return tl::unexpected(index.error());
    index_.emplace(std::move(*index));
    const auto parts = static_cast<std::size_t>(peers_.parts());
    if (auto ok = index_->Write(paths_.IndexOf(mesh, groups, parts)); !ok) return ok;
    return index_->Keep();
  }

  // It would name some new pieces and some old ones.
  Expected<void> DropOldIndex() const { return is_first() ? paths_.DropIndex() : Expected<void>(); }

  Expected<void> Place() {
    const auto placed = piece_->Finish();
    is_placed_ = placed.has_value();
    return placed;
  }

  Expected<void> PlaceIndex() {
    if (!is_first()) return {};
    // What an earlier run with more ranks left would be taken for pieces of this mesh.
    auto number = static_cast<std::size_t>(peers_.parts());
    while (paths_.DropPiece(number)) ++number;
    return index_->Finish();
  }

  void Drop() {
    piece_.reset();
    index_.reset();
    if (is_placed_) paths_.DropPiece(number_);
    peers_.Sum(0);  // all are gone
    if (has_made_folder_) paths_.DropEmptyFolder();
  }

  const PiecePaths paths_;
  const core::Peers& peers_;
  const std::size_t number_;
  std::optional<Draft> piece_, index_;
  bool has_made_folder_ = false, is_placed_ = false;
};

}  // namespace

Expected<void> Agree(const core::Peers& peers, const Expected<void>& own) {
  core::Peers::Bytes message;
  if (!own) {
    core::Pack(own.error().code, &message);
    for (const std::string* words : {&own.error().reason, &own.error().message}) {
      core::Pack(words->size(), &message);
      core::Pack(std::span<const char>(*words), &message);
    }
  }
  const std::vector<core::Peers::Bytes> all = peers.ToAll(std::move(message));
  const auto failed =
      std::find_if(all.begin(), all.end(), [](const auto& its) { return !its.empty(); });
  if (failed == all.end()) return {};
  core::Parcel parcel(*failed);
  Error error;
  error.code = parcel.Unpack<ErrorCode>();
  for (std::string* words : {&error.reason, &error.message}) {
    words->resize(parcel.Unpack<std::size_t>());
    parcel.Unpack(words->size(), words->data());
  }
  if (failed != all.begin())
    error.message = "rank " + std::to_string(failed - all.begin()) + ": " + error.message;
  return tl::unexpected(std::move(error));
}

Expected<void> SavePieces(const Mesh& mesh, const std::string& index, const core::Peers& peers) {
  return PieceFiles(index, peers).Go(mesh);
}

}  // namespace stellate::mpi
