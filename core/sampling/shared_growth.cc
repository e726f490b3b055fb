#include "core/sampling/shared_growth.h"

#include <algorithm>
#include <span>
#include <utility>

#include "core/base/parcel.h"
#include "core/parts/numbers.h"

namespace stellate::core {

template <int K>
void SharedGrowth<K>::CutUp(Boxes boxes) {
  if (peers_.parts() == 1) return;
  is_cut_up_ = true;
  own_ = Growth<K>(d_, own_.spacing(), false, Territory(peers_, std::move(boxes)));
}

template <int K>
std::vector<Eigen::Index> SharedGrowth<K>::Begin(const Eigen::MatrixXd& points,
                                                 const Eigen::MatrixXd& tangents,
                                                 const std::vector<std::uint8_t>& found,
                                                 double apart, const Eigen::VectorXd& shares) {
  std::vector<Eigen::Index> begun = own_.Begin(points, tangents, found, apart, shares);
  border_ += begun.size();
  return begun;
}

template <int K>
typename SharedGrowth<K>::Ring SharedGrowth<K>::Propose() {
  border_ = 0;
  Ring ring = own_.Propose();
  return is_cut_up_ ? RingOfAll(ring) : ring;
}

template <int K>
typename SharedGrowth<K>::Ring SharedGrowth<K>::RingOfAll(const Ring& own) {
  columns_ = NumbersOf(peers_, own_.RingKeys(), own_.patches());
  const auto numbers = [](const auto& array) {
    return std::span<const typename std::decay_t<decltype(array)>::value_type>(
        array.data(), static_cast<std::size_t>(array.size()));
  };
  Peers::Bytes message;
  Pack(columns_.size(), &message);
  Pack(numbers(columns_), &message);
  Pack(numbers(own.points), &message);
  Pack(numbers(own.tangents), &message);
  const std::vector<Peers::Bytes> all = peers_.ToAll(std::move(message));

  Eigen::Index count = 0;
  for (const Peers::Bytes& its : all)
    count += static_cast<Eigen::Index>(Parcel(its).Unpack<std::size_t>());
  Ring ring{Eigen::MatrixXd(d_, count), Eigen::MatrixXd(d_ * K, count), {}};
  std::vector<std::uint32_t> columns;
  for (const Peers::Bytes& its : all) {
    Parcel parcel(its);
    parcel.UnpackAll(&columns);
    for (const std::uint32_t c : columns)
      parcel.Unpack(static_cast<std::size_t>(d_), ring.points.col(c).data());
    for (const std::uint32_t c : columns)
      parcel.Unpack(static_cast<std::size_t>(d_) * K, ring.tangents.col(c).data());
  }
  return ring;
}

template <int K>
std::vector<Eigen::Index> SharedGrowth<K>::Join(const Eigen::MatrixXd& points,
                                                const Eigen::MatrixXd& tangents,
                                                const std::vector<std::uint8_t>& found,
                                                const Eigen::VectorXd& shares) {
  std::vector<Eigen::Index> joined;
  if (!is_cut_up_) {
    joined = own_.Join(points, tangents, found, shares);
  } else {
    std::vector<std::uint8_t> own_found;
    for (const std::uint32_t c : columns_) own_found.push_back(found[c]);
    joined = own_.Join(points(Eigen::all, columns_), tangents(Eigen::all, columns_), own_found);
    Peers::Bytes message;
    for (const Eigen::Index c : joined) Pack(columns_[static_cast<std::size_t>(c)], &message);
    joined.clear();
    for (const Peers::Bytes& its : peers_.ToAll(std::move(message)))
      for (Parcel parcel(its); !parcel.is_empty();)
        joined.push_back(parcel.Unpack<std::uint32_t>());
    std::sort(joined.begin(), joined.end());
  }
  border_ += joined.size();
  return joined;
}

STELLATE_INSTANTIATE_CLASS(SharedGrowth)

}  // namespace stellate::core
