#include "server/turns/turns.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/base/pauses.h"

namespace stellate::server {
namespace {

// Checks for interruption are made by the thousand; to ask for the time costs as much as ten of
// them.
constexpr unsigned kChecksPerLook = 16;

}  // namespace

// What one thread has of it.
class Turns::Turn {
 public:
  Turn(Turns& turns, const std::string& owner, const std::atomic<bool>& hurry)
      : turns_(turns), owner_(owner), hurry_(hurry) {
    turns_.Take(owner_, hurry_, this);
  }
  ~Turn() { turns_.Give(owner_, this); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

  // Lets others have theirs, if this one has lasted for a slice.
  void LookUp() {
    if (++checks_ % kChecksPerLook != 0) return;
    if (!is_held || !turns_.is_waited_for_.load(std::memory_order_relaxed)) return;
    if (Clock::now() - since < turns_.slice_) return;
    turns_.Take(owner_, hurry_, this);
  }

  bool is_held = false;
  TimePoint since;

 private:
  Turns& turns_;
  const std::string& owner_;
  const std::atomic<bool>& hurry_;
  unsigned checks_ = 0;
};

Turns::Turns(std::size_t most, Clock::duration slice, WeightOf weight_of)
    : most_(std::max(most, std::size_t{1})), slice_(slice), weight_of_(std::move(weight_of)) {}

std::size_t Turns::waiting() const {
  const std::lock_guard lock(mutex_);
  return waiters_.size();
}

void Turns::Run(const std::string& owner, const std::atomic<bool>& hurry,
                core::FunctionRef<void()> work) {
  Turn turn(*this, owner, hurry);
  const auto look_up = [&turn] { turn.LookUp(); };
  const core::Pauses pauses(look_up);
  work();
}

void Turns::Take(const std::string& owner, const std::atomic<bool>& hurry, Turn* turn) {
  std::unique_lock lock(mutex_);
  GiveLocked(owner, turn);
  Waiter waiter{owner};
  const FairQueue::Ticket ticket = queue_.Ask(owner);
  try {
    waiters_.emplace(ticket, &waiter);
  } catch (...) {
    queue_.TakeBack(owner, ticket);
    CallNextLocked();
    throw;
  }
  CallNextLocked();
  waiter.called.wait(lock, [&] { return waiter.has_turn || hurry; });
  if (!waiter.has_turn) queue_.TakeBack(owner, ticket);
  waiters_.erase(ticket);
  is_waited_for_ = !queue_.empty();
  turn->is_held = waiter.has_turn;
  turn->since = Clock::now();
}

void Turns::Give(const std::string& owner, Turn* turn) {
  const std::lock_guard lock(mutex_);
  GiveLocked(owner, turn);
  CallNextLocked();
}

void Turns::GiveLocked(const std::string& owner, Turn* turn) {
  if (!std::exchange(turn->is_held, false)) return;
  ChargeLocked(owner, Clock::now() - turn->since - slice_);
  --taken_;
}

void Turns::Hurry() {
  const std::lock_guard lock(mutex_);
  for (const auto& [ticket, waiter] : waiters_) waiter->called.notify_one();
}

void Turns::CallNextLocked() {
  while (taken_ < most_) {
    const auto next = queue_.Next();
    if (!next) break;
    Waiter& waiter = *waiters_.at(*next);
    waiter.has_turn = true;
    // Beforehand, so that one owner does not get all of several turns.
    ChargeLocked(waiter.owner, slice_);
    waiter.called.notify_one();
    ++taken_;
  }
  is_waited_for_ = !queue_.empty();
}

void Turns::ChargeLocked(const std::string& owner, Clock::duration time) {
  queue_.Charge(owner, std::chrono::duration<double>(time).count() / weight_of_(owner));
}

namespace {

class MesherInTurns final : public core::Mesher {
 public:
  MesherInTurns(std::unique_ptr<core::Mesher> mesher, std::shared_ptr<Turns> turns,
                std::string owner)
      : mesher_(std::move(mesher)), turns_(std::move(turns)), owner_(std::move(owner)) {}

  std::shared_ptr<const core::QueryBatch> NextBatch() override {
    std::shared_ptr<const core::QueryBatch> batch;
    turns_->Run(owner_, is_interrupted_, [&] { batch = mesher_->NextBatch(); });
    return batch;
  }
  core::Expected<core::MeshDelta> Absorb(const core::Answers& answers) override {
    core::Expected<core::MeshDelta> delta;
    turns_->Run(owner_, is_interrupted_, [&] { delta = mesher_->Absorb(answers); });
    return delta;
  }
  void Interrupt() override {
    mesher_->Interrupt();
    is_interrupted_ = true;
    turns_->Hurry();
  }
  void Cancel() override { mesher_->Cancel(); }
  void Fail(core::Status reason) override { mesher_->Fail(std::move(reason)); }
  const core::Specification& specification() const override { return mesher_->specification(); }
  const core::Progress& progress() const override { return mesher_->progress(); }
  const core::Report& report() const override { return mesher_->report(); }
  Eigen::Map<const Eigen::MatrixXd> Points() const override { return mesher_->Points(); }
  Eigen::MatrixXd Tangents() const override { return mesher_->Tangents(); }
  std::vector<std::uint32_t> Simplices() const override { return mesher_->Simplices(); }
  std::vector<std::int8_t> Labels() const override { return mesher_->Labels(); }

 private:
  const std::unique_ptr<core::Mesher> mesher_;
  const std::shared_ptr<Turns> turns_;
  const std::string owner_;
  std::atomic<bool> is_interrupted_ = false;
};

}  // namespace

std::unique_ptr<core::Mesher> InTurns(std::unique_ptr<core::Mesher> mesher,
                                      std::shared_ptr<Turns> turns, std::string owner) {
  return std::make_unique<MesherInTurns>(std::move(mesher), std::move(turns), std::move(owner));
}

}  // namespace stellate::server
