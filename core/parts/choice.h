#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/local_maxima.h"
#include "core/base/parcel.h"
#include "core/parts/territory.h"

namespace stellate::core {

// What parts tell each other of a choice: each of their own things once, when it is decided.
template <typename VisitStronger>
class ChoiceNews {
 public:
  explicit ChoiceNews(const Borders& borders) : seen_(borders.seen) {
    for (const auto& shown : borders.shown) {
      unsaid_.emplace_back();
      for (std::uint32_t at = 0; at < shown.size(); ++at) unsaid_.back().push_back({at, shown[at]});
    }
  }

  void Exchange(const Peers& peers, LocalMaxima<VisitStronger>* choice) {
    std::vector<Peers::Bytes> news(unsaid_.size());
    for (std::size_t part = 0; part < news.size(); ++part)
      std::erase_if(unsaid_[part], [&](const Shown& shown) {
        if (choice->IsOpen(shown.thing)) return false;
        Pack(shown.at, &news[part]);
        Pack(static_cast<std::uint8_t>(choice->IsChosen(shown.thing)), &news[part]);
        return true;
      });
    news = peers.Exchange(std::move(news));
    for (std::size_t part = 0; part < news.size(); ++part)
      for (Parcel parcel(news[part]); !parcel.is_empty();) {
        const auto at = parcel.Unpack<std::uint32_t>();
        choice->Take(seen_[part][at], parcel.Unpack<std::uint8_t>() != 0);
      }
  }

 private:
  struct Shown {
    std::uint32_t at, thing;  // in the list of what is shown
  };
  const std::vector<std::vector<std::uint32_t>>& seen_;
  std::vector<std::vector<Shown>> unsaid_;  // by part
};

// Makes the choice of ChooseLocalMaxima among the things of all parts. Each part lists its own and,
// of others', all that are in conflict with these; `borders` says which those are. Returns 1 for
// each thing in the list that is chosen, else 0.
template <typename VisitStronger>
std::vector<std::uint8_t> ChooseLocalMaxima(const Peers& peers, const Borders& borders,
                                            std::size_t count,
                                            const VisitStronger& visit_stronger) {
  if (peers.parts() == 1) return ChooseLocalMaxima(count, visit_stronger);
  std::vector<std::uint8_t> elsewhere(count);
  for (const auto& seen : borders.seen)
    for (const std::uint32_t i : seen) elsewhere[i] = 1;
  LocalMaxima<VisitStronger> choice(count, visit_stronger, std::move(elsewhere));
  ChoiceNews<VisitStronger> news(borders);
  std::size_t open = 0;
  do {
    open = choice.DecideOwn();
    news.Exchange(peers, &choice);
  } while (peers.Sum(open).all > 0);
  return choice.Chosen();
}

}  // namespace stellate::core
