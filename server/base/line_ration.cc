#include "server/base/line_ration.h"

#include <algorithm>
#include <iterator>

namespace stellate::server {

void LineRation::Refill(Party* party, Time now) const {
  const std::chrono::duration<double> passed = now - party->at;
  party->lines = std::min(burst_, party->lines + per_second_ * std::max(passed.count(), 0.0));
  party->at = now;
}

bool LineRation::Take(const std::string& name, Time now) {
  const std::lock_guard lock(mutex_);
  Party& party = parties_.try_emplace(name, Party{burst_, now, 0}).first->second;
  Refill(&party, now);
  if (party.lines < 1) {
    ++party.left_out;
    return false;
  }
  party.lines -= 1;
  return true;
}

std::vector<std::pair<std::string, std::uint64_t>> LineRation::TakeLeftOut(Time now) {
  std::vector<std::pair<std::string, std::uint64_t>> left_out;
  const std::lock_guard lock(mutex_);
  for (auto it = parties_.begin(); it != parties_.end();) {
    auto& [name, party] = *it;
    Refill(&party, now);
    if (party.left_out > 0) left_out.emplace_back(name, std::exchange(party.left_out, 0));
    it = party.lines >= burst_ ? parties_.erase(it) : std::next(it);
  }
  return left_out;
}

}  // namespace stellate::server
