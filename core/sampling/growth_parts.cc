// How a part of a sample learns what lies around its territory. Everything is listed in the order
// that the whole has it in, so that each part decides as the whole does.

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/sampling/growth.h"

namespace stellate::core {
namespace {

// The share of a radius that rounding can take.
constexpr double kMore = 1 + 1e-6;

// Packs some of many things, of `each` numbers.
template <typename Number>
void PackSome(const UnsetVector<Number>& from, std::size_t each,
              const std::vector<std::uint32_t>& columns, Peers::Bytes* message) {
  for (const std::uint32_t c : columns)
    Pack(std::span<const Number>(from.data() + c * each, each), message);
}

// What parts have sent to each other's lists: by part, which of its own.
using Shown = std::vector<std::vector<std::uint32_t>>;

// Shows each of so many things to all parts near it.
template <typename PointOf>
Shown ShowToNear(const Territory& territory, std::size_t count, double halo,
                 const PointOf& point_of) {
  Shown shown(static_cast<std::size_t>(territory.peers().parts()));
  for (std::uint32_t i = 0; i < count; ++i)
    territory.ForEachNear(point_of(i), halo,
                          [&](int part) { shown[static_cast<std::size_t>(part)].push_back(i); });
  return shown;
}

// A thing that a part has been sent: whose, and which of what that one has sent.
struct Sent {
  OrderKey key;
  std::uint32_t part, at;
};

// Puts what a part has been sent in order. `shown`: what it has sent, itself too, all of its own.
// Returns in which place of what was sent each is found, and the borders of the list.
std::vector<std::uint32_t> PutInOrder(std::vector<Sent> sent, const Shown& shown, int own,
                                      Borders* borders) {
  std::vector<std::uint32_t> order(sent.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t i, std::uint32_t j) { return sent[i].key < sent[j].key; });
  borders->seen.assign(shown.size(), {});
  for (const Sent& it : sent) {
    auto& list = borders->seen[it.part];
    list.resize(std::max<std::size_t>(list.size(), it.at + 1));
  }
  for (std::uint32_t place = 0; place < order.size(); ++place)
    borders->seen[sent[order[place]].part][sent[order[place]].at] = place;
  const std::vector<std::uint32_t> of_own =
      std::exchange(borders->seen[static_cast<std::size_t>(own)], {});
  borders->shown = shown;
  borders->shown[static_cast<std::size_t>(own)].clear();
  for (auto& list : borders->shown)
    for (std::uint32_t& i : list) i = of_own[i];
  return order;
}

}  // namespace

// A part makes those places whose mean lies in its territory. Proposals of one lie within 2 kMerged
// of it, and what else may begin a place of theirs within 3; the parents of all are a vector of the
// lattice away. What takes a place, and what keeps an answer from joining, is nearer. (A namesake
// from farther away could begin a place between two of these: a lattice would have to meet itself.)
template <int K>
double Growth<K>::Halo() const {
  return kMore * (longest_ + 3 * kMerged * spacing_);
}

template <int K>
void Growth<K>::Sites::PackTo(Peers::Bytes* message,
                              const std::vector<std::uint32_t>& columns) const {
  const std::size_t stride = size() == 0 ? 0 : points.size() / size();
  PackSome(points, stride, columns, message);
  PackSome(frames, stride * K, columns, message);
  PackSome(shares, 1, columns, message);
  PackSome(patch, 1, columns, message);
  PackSome(name, 1, columns, message);
}

template <int K>
void Growth<K>::Sites::UnpackAt(std::size_t at, std::size_t count, std::size_t stride,
                                Parcel* parcel) {
  parcel->Unpack(count * stride, points.data() + at * stride);
  parcel->Unpack(count * stride * K, frames.data() + at * stride * K);
  parcel->Unpack(count, shares.data() + at);
  parcel->Unpack(count, patch.data() + at);
  parcel->Unpack(count, name.data() + at);
}

// Lists the places in a part's territory and those that some of these may be merged with, or with
// whose leader: others made these.
template <int K>
Borders Growth<K>::SharePlaces(Proposed* places) const {
  if (territory_.is_whole()) return {};
  const auto point_of = [&](std::uint32_t i) { return places->sites.points.data() + i * stride(); };
  std::vector<std::uint32_t> own;
  for (std::uint32_t i = 0; i < places->sites.size(); ++i) {
    if (!territory_.Owns(point_of(i))) continue;
    places->first[i] = border_numbers_[places->first[i]];
    own.push_back(i);
  }
  const Shown shown = ShowToNear(territory_, own.size(), kMore * 2 * kMerged * spacing_,
                                 [&](std::uint32_t i) { return point_of(own[i]); });
  std::vector<Peers::Bytes> messages(shown.size());
  for (std::size_t part = 0; part < shown.size(); ++part) {
    std::vector<std::uint32_t> columns;
    for (const std::uint32_t i : shown[part]) columns.push_back(own[i]);
    Peers::Bytes& message = messages[part];
    Pack(columns.size(), &message);
    places->sites.PackTo(&message, columns);
    PackSome(places->first, 1, columns, &message);
    PackSome(places->parents, 1, columns, &message);
    PackSome(places->clear, 1, columns, &message);
  }
  messages = territory_.peers().Exchange(std::move(messages));

  std::size_t count = 0;
  for (const Peers::Bytes& message : messages) count += Parcel(message).Unpack<std::size_t>();
  Proposed all(count, stride());
  std::vector<Sent> sent;
  for (std::uint32_t part = 0; part < messages.size(); ++part) {
    Parcel parcel(messages[part]);
    const std::size_t at = sent.size(), its = parcel.Unpack<std::size_t>();
    all.sites.UnpackAt(at, its, stride(), &parcel);
    parcel.Unpack(its, all.first.data() + at);
    parcel.Unpack(its, all.parents.data() + at);
    parcel.Unpack(its, all.clear.data() + at);
    for (std::uint32_t i = 0; i < its; ++i) sent.push_back({all.KeyOf(at + i), part, i});
  }
  Borders borders;
  const std::vector<std::uint32_t> order =
      PutInOrder(std::move(sent), shown, territory_.peers().part(), &borders);
  *places = Proposed(count, stride());
  places->sites.Put(0, all.sites, order);
  for (std::size_t i = 0; i < count; ++i) {
    places->first[i] = all.first[order[i]];
    places->parents[i] = all.parents[order[i]];
    places->clear[i] = all.clear[order[i]];
  }
  return borders;
}

// Who asked a question takes the answer, and knows the sample around it. It lies within
// kFarthestAnswer of its query, and that within kMerged of the territory.
template <int K>
Borders Growth<K>::ShareContenders(const Proposed& proposed, Contenders* contenders) const {
  if (territory_.is_whole()) return {};
  const Contenders& own = *contenders;
  const Shown shown = ShowToNear(territory_, own.columns.size(),
                                 kMore * (kFarthestAnswer + kMerged + kKeep) * spacing_,
                                 [&](std::uint32_t i) { return own.points.data() + i * stride(); });
  std::vector<Peers::Bytes> messages(shown.size());
  for (std::size_t part = 0; part < shown.size(); ++part)
    for (const std::uint32_t i : shown[part]) {
      const OrderKey key = proposed.KeyOf(own.columns[i]);
      Pack(key.patch, &messages[part]);
      Pack(key.name, &messages[part]);
      Pack(key.first, &messages[part]);
      Pack(own.parents[i], &messages[part]);
      Pack(own.shares[i], &messages[part]);
      Pack(std::span<const double>(own.points.data() + i * stride(), stride()), &messages[part]);
    }
  messages = territory_.peers().Exchange(std::move(messages));

  std::vector<Sent> sent;
  std::vector<int> parents;
  std::vector<double> points, shares;
  const auto here = static_cast<std::uint32_t>(territory_.peers().part());
  for (std::uint32_t part = 0; part < messages.size(); ++part) {
    std::uint32_t at = 0;
    for (Parcel parcel(messages[part]); !parcel.is_empty(); ++at) {
      const auto patch = parcel.Unpack<std::uint32_t>();
      const auto name = parcel.Unpack<std::uint64_t>();
      sent.push_back({{patch, name, parcel.Unpack<std::uint32_t>()}, part, at});
      parents.push_back(parcel.Unpack<int>());
      shares.push_back(parcel.Unpack<double>());
      points.resize(points.size() + stride());
      parcel.Unpack(stride(), points.data() + points.size() - stride());
    }
  }
  Borders borders;
  const std::vector<std::uint32_t> order =
      PutInOrder(sent, shown, static_cast<int>(here), &borders);
  Contenders all;
  all.points.resize(points.size());
  all.shares.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Sent& it = sent[order[i]];
    all.columns.push_back(it.part == here ? own.columns[it.at] : kNoColumn);
    all.parents.push_back(parents[order[i]]);
    all.shares[i] = shares[order[i]];
    std::copy_n(points.data() + order[i] * stride(), stride(), all.points.data() + i * stride());
  }
  *contenders = std::move(all);
  return borders;
}

// All parts have the same seeds: who owns the place of one knows whether anything is near it.
template <int K>
void Growth<K>::ShareFar(const Candidates& candidates, std::vector<std::uint8_t>* far) const {
  if (territory_.is_whole()) return;
  Peers::Bytes taken;
  for (std::uint32_t i = 0; i < far->size(); ++i)
    if (!(*far)[i] && territory_.Owns(candidates.points.data() + i * stride())) Pack(i, &taken);
  const auto parts = static_cast<std::size_t>(territory_.peers().parts());
  std::fill(far->begin(), far->end(), std::uint8_t{1});
  for (const Peers::Bytes& message : territory_.peers().Exchange(std::vector(parts, taken)))
    for (Parcel parcel(message); !parcel.is_empty();) (*far)[parcel.Unpack<std::uint32_t>()] = 0;
}

template <int K>
std::vector<OrderKey> Growth<K>::RingKeys() const {
  std::vector<OrderKey> keys(asked_.sites.size());
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = asked_.KeyOf(i);
  return keys;
}

// Of sites that all parts have.
template <int K>
void Growth<K>::KeepNear(Sites* sites) {
  if (territory_.is_whole()) return;
  border_numbers_.clear();
  for (std::uint32_t i = 0; i < sites->size(); ++i)
    territory_.ForEachNear(sites->points.data() + i * stride(), Halo(), [&](int part) {
      if (part == territory_.peers().part()) border_numbers_.push_back(i);
    });
  Sites near;
  near.Resize(border_numbers_.size(), stride(), false);
  near.Put(0, *sites, border_numbers_);
  *sites = std::move(near);
}

// `keys`: of the sites, by which they are put in order, over all parts.
template <int K>
void Growth<K>::CarryToAll(const std::vector<OrderKey>& keys, Sites sites) {
  if (territory_.is_whole()) return Carry(std::move(sites));
  const std::vector<std::uint32_t> numbers = NumbersOf(territory_.peers(), keys, patches_);
  const Shown shown = ShowToNear(territory_, sites.size(), Halo(), [&](std::uint32_t i) {
    return sites.points.data() + i * stride();
  });
  std::vector<Peers::Bytes> messages(shown.size());
  for (std::size_t part = 0; part < shown.size(); ++part) {
    Pack(shown[part].size(), &messages[part]);
    for (const std::uint32_t i : shown[part]) Pack(numbers[i], &messages[part]);
    sites.PackTo(&messages[part], shown[part]);
  }
  messages = territory_.peers().Exchange(std::move(messages));

  std::size_t count = 0;
  for (const Peers::Bytes& message : messages) count += Parcel(message).Unpack<std::size_t>();
  Sites all;
  all.Resize(count, stride(), false);
  std::vector<std::uint32_t> all_numbers(count), order(count);
  std::size_t at = 0;
  for (const Peers::Bytes& message : messages) {
    Parcel parcel(message);
    const auto its = parcel.Unpack<std::size_t>();
    parcel.Unpack(its, all_numbers.data() + at);
    all.UnpackAt(at, its, stride(), &parcel);
    at += its;
  }
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t i, std::uint32_t j) { return all_numbers[i] < all_numbers[j]; });
  border_numbers_.clear();
  for (const std::uint32_t i : order) border_numbers_.push_back(all_numbers[i]);
  Sites sorted;
  sorted.Resize(count, stride(), false);
  sorted.Put(0, all, order);
  Carry(std::move(sorted));
}

#define STELLATE_EACH(K)                                                                          \
  template void Growth<K>::Sites::PackTo(Peers::Bytes*, const std::vector<std::uint32_t>&) const; \
  template void Growth<K>::Sites::UnpackAt(std::size_t, std::size_t, std::size_t, Parcel*);       \
  template double Growth<K>::Halo() const;                                                        \
  template Borders Growth<K>::SharePlaces(Proposed*) const;                                       \
  template Borders Growth<K>::ShareContenders(const Proposed&, Contenders*) const;                \
  template void Growth<K>::ShareFar(const Candidates&, std::vector<std::uint8_t>*) const;         \
  template std::vector<OrderKey> Growth<K>::RingKeys() const;                                     \
  template void Growth<K>::KeepNear(Sites*);                                                      \
  template void Growth<K>::CarryToAll(const std::vector<OrderKey>&, Sites);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
