#include "core/refinement/boundary_state.h"

#include <algorithm>

namespace stellate::core {
namespace {

// As a share of a wall's largest clearance so far: a smaller one may be zero, which a query
// decides.
constexpr double kMaybeZero = 1e-6;
// The same, of an arrangement: it may be meant to be zero.
constexpr double kMaybeMeant = 1e-3;

}  // namespace

template <int K>
void BoundaryState<K>::NoteClearances(const AnsweredPoints& answers, Eigen::Index c) {
  if (largest_clearances_.size() == 0) largest_clearances_.setZero(answers.clearances.rows());
  largest_clearances_ = largest_clearances_.cwiseMax(answers.clearances.col(c).cwiseAbs());
}

template <int K>
bool BoundaryState<K>::KeepCrowd(const AnsweredPoints& answers, Eigen::Index c, double same) {
  if (K == 1 || largest_clearances_.size() == 0) return false;
  Crowd crowd;
  crowd.walls = answers.walls[static_cast<std::size_t>(c)];
  for (Eigen::Index i = 0; i < answers.clearances.rows(); ++i) {
    const WallSet wall = SetOfWall(static_cast<int>(i));
    if (IsSubset(wall, crowd.walls)) continue;
    const double share = answers.labels.empty() ? kMaybeZero : kMaybeMeant;
    if (std::abs(answers.clearances(i, c)) <= share * largest_clearances_[i])
      crowd.possible |= wall;
    if (answers.clearances(i, c) < 0) crowd.beyond |= wall;
  }
  if (crowd.possible == 0) return false;
  if (answers.labels.empty() && !IsSubset(crowd.beyond, crowd.possible)) return false;
  crowd.point = answers.points.col(c);
  for (const Eigen::VectorXd& other : crowded_)
    if ((other - crowd.point).norm() <= same) return true;
  crowd.tangent = answers.tangents.col(c);
  crowd.conormals = answers.conormals.col(c);
  if (answers.sizes.size() > 0) crowd.size = answers.sizes[c];
  crowd.signs = answers.SignsOf(c);
  crowded_.push_back(crowd.point);
  crowds_.push_back(std::move(crowd));
  return true;
}

STELLATE_INSTANTIATE_CLASS(BoundaryState)

}  // namespace stellate::core
