#include "core/parts/numbers.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/base/parcel.h"

namespace stellate::core {

// Each part puts in order the keys of some patches, all parts'.
std::vector<std::uint32_t> NumbersOf(const Peers& peers, std::span<const OrderKey> keys,
                                     std::uint32_t patches) {
  const auto parts = static_cast<std::size_t>(peers.parts());
  const auto sorter = [&](const OrderKey& key) { return std::size_t{key.patch} * parts / patches; };
  std::vector<Peers::Bytes> messages(parts);
  for (const OrderKey& key : keys) {
    Peers::Bytes* const message = &messages[sorter(key)];
    Pack(key.patch, message);
    Pack(key.name, message);
    Pack(key.first, message);
  }
  messages = peers.Exchange(std::move(messages));

  struct Given {
    OrderKey key;
    std::uint32_t part, at;  // in its message
  };
  std::vector<Given> given;
  for (std::uint32_t part = 0; part < parts; ++part) {
    std::uint32_t at = 0;
    for (Parcel parcel(messages[part]); !parcel.is_empty(); ++at) {
      const auto patch = parcel.Unpack<std::uint32_t>();
      const auto name = parcel.Unpack<std::uint64_t>();
      given.push_back({{patch, name, parcel.Unpack<std::uint32_t>()}, part, at});
    }
    messages[part].assign(at * sizeof(std::uint32_t), std::byte{});
  }
  std::sort(given.begin(), given.end(),
            [](const Given& a, const Given& b) { return a.key < b.key; });
  auto number = static_cast<std::uint32_t>(peers.Sum(given.size()).before);
  for (const Given& it : given) {
    std::memcpy(messages[it.part].data() + it.at * sizeof(number), &number, sizeof(number));
    ++number;
  }
  messages = peers.Exchange(std::move(messages));

  std::vector<std::uint32_t> numbers;
  numbers.reserve(keys.size());
  std::vector<Parcel> parcels(messages.begin(), messages.end());
  for (const OrderKey& key : keys) numbers.push_back(parcels[sorter(key)].Unpack<std::uint32_t>());
  return numbers;
}

}  // namespace stellate::core
