#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/parts/boxes.h"
#include "core/peers.h"
#include "core/sampling/growth.h"

namespace stellate::core {

// A Growth that many parts share the work of: each grows what lies in its box, and tells all others
// of it, so that all have the rings of the whole. Until it is cut up, each grows the whole.
template <int K>
class SharedGrowth {
 public:
  using Ring = typename Growth<K>::Ring;

  // As of Growth. `peers` is borrowed.
  SharedGrowth(int d, double spacing, bool predicts, const Peers& peers)
      : d_(d), peers_(peers), own_(d, spacing, predicts) {}

  // From now on each part grows in its box. No effect in one part. REQUIRES: nothing has begun, it
  // does not predict, and no shares will come.
  void CutUp(Boxes boxes);

  // As those of Growth, all of the whole's.
  std::vector<Eigen::Index> Begin(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                                  const std::vector<std::uint8_t>& found, double apart,
                                  const Eigen::VectorXd& shares = {});
  Ring Propose();
  std::vector<Eigen::Index> Join(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                                 const std::vector<std::uint8_t>& found,
                                 const Eigen::VectorXd& shares = {});
  void Forget() { own_.Forget(); }
  // REQUIRES: it is not cut up.
  std::uint32_t size() const { return own_.size(); }
  std::size_t border() const { return border_; }
  double spacing() const { return own_.spacing(); }
  double reach() const { return own_.reach(); }

 private:
  Ring RingOfAll(const Ring& own);

  int d_;
  const Peers& peers_;
  Growth<K> own_;
  bool is_cut_up_ = false;
  std::vector<std::uint32_t> columns_;  // of a part's last ring, in that of all
  std::size_t border_ = 0;
};

STELLATE_DECLARE_CLASS(SharedGrowth)

}  // namespace stellate::core
