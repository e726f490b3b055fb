#include "server/turns/fair_queue.h"

#include <algorithm>

namespace stellate::server {

FairQueue::Ticket FairQueue::Ask(const std::string& owner) {
  Owner& asking = owners_[owner];
  asking.had = std::max(asking.had, now_);
  asking.waiting.push_back(next_ticket_);
  ++waiting_;
  return next_ticket_++;
}

bool FairQueue::TakeBack(const std::string& owner, Ticket ticket) {
  const auto it = owners_.find(owner);
  if (it == owners_.end() || std::erase(it->second.waiting, ticket) == 0) return false;
  --waiting_;
  return true;
}

std::optional<FairQueue::Ticket> FairQueue::Next() {
  Owner* next = nullptr;
  for (auto& [name, owner] : owners_) {
    if (owner.waiting.empty()) continue;
    const bool is_earlier =
        next == nullptr || owner.had < next->had ||
        (owner.had == next->had && owner.waiting.front() < next->waiting.front());
    if (is_earlier) next = &owner;
  }
  if (next == nullptr) return std::nullopt;
  const Ticket ticket = next->waiting.front();
  next->waiting.pop_front();
  --waiting_;
  now_ = std::max(now_, next->had);
  // Who would start where others are is as one who was never here.
  std::erase_if(owners_, [this, next](const auto& entry) {
    return &entry.second != next && entry.second.waiting.empty() && entry.second.had <= now_;
  });
  return ticket;
}

void FairQueue::Charge(const std::string& owner, double cost) {
  const auto [it, is_new] = owners_.try_emplace(owner);
  if (is_new) it->second.had = now_;
  it->second.had += cost;
}

}  // namespace stellate::server
