#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "core/reconstruction.h"
#include "core/specification.h"
#include "server/base/refusal.h"

namespace stellate::server {

// Estimates the memory of a running mesh with `vertices` vertices, in bytes, with its history,
// during a round of `queries`. For k <= 3 it is 0.8 to 1.5 times the measured memory
// (`tests/bench/run memory`), without that of an idle process.
std::uint64_t EstimateMeshBytes(const core::Specification& spec, std::uint64_t vertices,
                                std::uint64_t queries);

// Estimates the memory of a reconstruction from `points` points, in bytes, from its declaration to
// its end.
std::uint64_t EstimateReconstructionBytes(const core::ReconstructionSpecification& spec,
                                          std::uint64_t points);

// Estimates the memory of an ended mesh without its history: itself, and its seeds.
std::uint64_t EstimateFinishedBytes(const core::Specification& spec);

// Estimates the memory of an open call whose client reads nothing: itself, and a message of `part`
// bytes or with the specification, both parsed and serialized.
std::uint64_t EstimateStreamBytes(const core::Specification& spec, std::uint64_t part);

// Keeps the estimates of all meshes below a budget, and those of each owner. Any thread.
//
//   auto account = MemoryBudget::Open(budget, owner);   // for a mesh, as long as it lives
//   if (auto refused = account->Set(bytes)) ...         // it may not grow
class MemoryBudget {
 public:
  // 0: no limit. `owner` holds for named owners.
  struct Limits {
    std::uint64_t server = 0;
    std::uint64_t owner = 0;
  };
  // Open calls have a budget of their own, an eighth of the limits (and 4 MiB at least), so that
  // finished meshes that fill the budget of meshes can still be read.
  enum class Of { kMeshes, kStreams };
  explicit MemoryBudget(Limits limits, Of what = Of::kMeshes) : what_(what), limits_(limits) {}

  // The share of one mesh or call, released by the destructor.
  class Account {
   public:
    ~Account() { budget_->Release(this); }
    Account(const Account&) = delete;
    Account& operator=(const Account&) = delete;

    // Sets the estimate of its memory. kLimitExceeded, with the old value kept, if it grew and the
    // budget does not allow it, even after releasing memory as MakeRoomBy says; a smaller value is
    // always allowed.
    std::optional<Refused> Set(std::uint64_t bytes) {
      auto refused = TrySet(bytes);
      if (refused && budget_->make_room_ && budget_->make_room_()) refused = TrySet(bytes);
      return refused;
    }
    // The same, without releasing memory.
    std::optional<Refused> TrySet(std::uint64_t bytes) { return budget_->Set(this, bytes, false); }
    // For a mesh of an earlier server, which exists already.
    void SetUnchecked(std::uint64_t bytes) { budget_->Set(this, bytes, true); }
    std::uint64_t bytes() const { return budget_->BytesOf(this); }

   private:
    friend class MemoryBudget;
    Account(std::shared_ptr<MemoryBudget> budget, std::string owner)
        : budget_(std::move(budget)), owner_(std::move(owner)) {}

    const std::shared_ptr<MemoryBudget> budget_;
    const std::string owner_;
    std::uint64_t bytes_ = 0;  // the budget's lock guards it
  };

  // `make_room` releases memory that no client needs; false: there was none. Called on any thread.
  // Set it before the first Open.
  void MakeRoomBy(std::function<bool()> make_room) { make_room_ = std::move(make_room); }

  // For a new mesh or call of `owner`, with nothing in it.
  static std::unique_ptr<Account> Open(std::shared_ptr<MemoryBudget> budget, std::string owner);

  // From now on. What is held stays held, where it is more: it may not grow.
  void SetLimits(Limits limits);
  std::uint64_t total() const;

 private:
  std::optional<Refused> Set(Account* account, std::uint64_t bytes, bool unchecked);
  std::optional<Refused> Check(const std::string& owner, std::uint64_t bytes, std::uint64_t total,
                               std::uint64_t owned) const;
  std::uint64_t Share(std::uint64_t limit) const;
  void Release(Account* account);
  std::uint64_t BytesOf(const Account* account) const;

  const Of what_;
  std::function<bool()> make_room_;
  mutable std::mutex mutex_;  // of all that follows
  Limits limits_;
  std::uint64_t total_ = 0;
  std::map<std::string, std::uint64_t> by_owner_;
};

}  // namespace stellate::server
