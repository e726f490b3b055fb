#include "server/memory/memory_budget.h"

#include <algorithm>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;

// Beside coordinates: a vertex's star, its neighbours, what the certificate keeps of it. By k, as
// `tests/bench/run memory` measures it; for k > 3, where that takes hours, as it was once.
constexpr std::uint64_t kStarBytes[] = {0, 420, 330, 4300, 25'000, 150'000};
static_assert(std::size(kStarBytes) == core::kMaxDimension + 1);
constexpr std::uint64_t kEmptyMeshBytes = std::uint64_t{1} << 16;  // one with nothing in it
// Of a point of a cloud, beside it and its tangent basis, by k: its star and its neighbours; and of
// each coordinate for k = 3: the centres of some 27 tetrahedra.
constexpr std::uint64_t kReconstructedBytes[] = {0, 450, 450, 3850};
static_assert(std::size(kReconstructedBytes) == core::kMaxReconstructionDimension + 1);
constexpr std::uint64_t kCentreBytes = 180;
// The cloud's, the stars' and the result's points and tangent bases.
constexpr std::uint64_t kCopies = 3;
// Besides, for k <= 2, where weights are sought of all points. For k = 3 they are sought before the
// stars are built, which take more.
constexpr std::uint64_t kWeighedBytes = 800;
constexpr std::uint64_t kFinishedBytes = std::uint64_t{1} << 14;  // without history and seeds
constexpr std::uint64_t kCallBytes = std::uint64_t{1} << 15;      // that sends nothing
constexpr std::uint64_t kLeastOfStreams = std::uint64_t{4} << 20;

std::uint64_t SeedBytes(const core::Specification& spec) {
  return static_cast<std::uint64_t>(spec.seeds.size()) * sizeof(double);
}

}  // namespace

std::uint64_t EstimateMeshBytes(const core::Specification& spec, std::uint64_t vertices,
                                std::uint64_t queries) {
  const auto d = static_cast<std::uint64_t>(spec.ambient_dimension);
  const auto k = static_cast<std::uint64_t>(std::clamp(spec.dimension, 1, core::kMaxDimension));
  // A point and its tangent basis: in the sample and, while that grows, half as much again, in the
  // round that brought it; the point in the search tree and the history, too.
  const std::uint64_t coordinates = sizeof(double) * d * (5 * (k + 1) / 2 + 1);
  // How far each is from the walls, as the certificate holds it against the mesh.
  const auto walls = static_cast<std::uint64_t>(spec.walls);
  const std::uint64_t clearances = walls > 0 ? sizeof(double) * 2 * (d + walls) : 0;
  const std::uint64_t seeds = 3 * SeedBytes(spec);  // the mesh's, its pool's, the mesher's
  // A question, and its answer with a basis.
  const std::uint64_t message = sizeof(double) * d * (k + 2);
  return kEmptyMeshBytes + seeds + vertices * (coordinates + clearances + kStarBytes[k]) +
         queries * message;
}

std::uint64_t EstimateReconstructionBytes(const core::ReconstructionSpecification& spec,
                                          std::uint64_t points) {
  const auto d = static_cast<std::uint64_t>(spec.ambient_dimension);
  const auto k = static_cast<std::uint64_t>(spec.dimension);
  const bool weighs = spec.weights == core::Weighting::kOnly && k <= 2;
  const std::uint64_t star = kReconstructedBytes[k] + (k == 3 ? kCentreBytes * d : 0);
  const std::uint64_t vertices = points + core::MostAdded(spec, points);
  return kEmptyMeshBytes +
         vertices * (kCopies * sizeof(double) * d * (k + 1) + star + (weighs ? kWeighedBytes : 0));
}

std::uint64_t EstimateFinishedBytes(const core::Specification& spec) {
  return kFinishedBytes + 2 * SeedBytes(spec);
}

std::uint64_t EstimateStreamBytes(const core::Specification& spec, std::uint64_t part) {
  return kCallBytes + 2 * std::max(part, SeedBytes(spec));
}

std::unique_ptr<MemoryBudget::Account> MemoryBudget::Open(std::shared_ptr<MemoryBudget> budget,
                                                          std::string owner) {
  return std::unique_ptr<Account>(new Account(std::move(budget), std::move(owner)));
}

// Of a limit that is set.
std::uint64_t MemoryBudget::Share(std::uint64_t limit) const {
  return what_ == Of::kMeshes ? limit : std::max(limit / 8, kLeastOfStreams);
}

// Whether the sums `total` and `owned` are within the limits, `bytes` of them this account's.
std::optional<Refused> MemoryBudget::Check(const std::string& owner, std::uint64_t bytes,
                                           std::uint64_t total, std::uint64_t owned) const {
  const bool meshes = what_ == Of::kMeshes;
  const auto refuse = [&](const char* setting, const char* scope, std::uint64_t limit,
                          const std::string& whose, std::uint64_t sum, const char* whom) {
    return Refused(
        {setting, Message(limit), scope},
        Message(whose, meshes ? " meshes" : " watchers, downloads and workers",
                " would hold about ", sum, " bytes, this one ", bytes,
                " of them, but the server allows ", whom, Share(limit),
                meshes ? "" : Message(", a part of --", setting), ": ",
                meshes ? "delete meshes that are no longer needed, ask for a larger epsilon or "
                         "fewer vertices"
                       : "end those that are not needed",
                ", or raise --", setting));
  };
  if (limits_.server > 0 && total > Share(limits_.server)) {
    return refuse("max-memory-bytes", "server", limits_.server, "the server's", total, "");
  }
  if (limits_.owner > 0 && !owner.empty() && owned > Share(limits_.owner)) {
    return refuse("owner-memory-bytes", "owner", limits_.owner, "your", owned, "each owner ");
  }
  return std::nullopt;
}

std::optional<Refused> MemoryBudget::Set(Account* account, std::uint64_t bytes, bool unchecked) {
  const std::lock_guard lock(mutex_);
  const std::uint64_t old = account->bytes_;
  std::uint64_t& owners = by_owner_[account->owner_];
  const std::uint64_t total = total_ - old + bytes;
  const std::uint64_t owned = owners - old + bytes;
  if (bytes > old && !unchecked) {
    if (auto refused = Check(account->owner_, bytes, total, owned)) return refused;
  }
  total_ = total;
  owners = owned;
  account->bytes_ = bytes;
  return std::nullopt;
}

void MemoryBudget::Release(Account* account) {
  const std::lock_guard lock(mutex_);
  total_ -= account->bytes_;
  const auto owner = by_owner_.find(account->owner_);
  if (owner == by_owner_.end()) return;
  owner->second -= account->bytes_;
  if (owner->second == 0) by_owner_.erase(owner);
}

std::uint64_t MemoryBudget::BytesOf(const Account* account) const {
  const std::lock_guard lock(mutex_);
  return account->bytes_;
}

void MemoryBudget::SetLimits(Limits limits) {
  const std::lock_guard lock(mutex_);
  limits_ = limits;
}

std::uint64_t MemoryBudget::total() const {
  const std::lock_guard lock(mutex_);
  return total_;
}

}  // namespace stellate::server
