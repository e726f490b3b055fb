#include "core/run/spare_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/certificate/evidence/evidence.h"

namespace stellate::core {
namespace {

// Each time finds a part of M that was missed, and most manifolds have one part.
constexpr int kMostChosen = 16;

// Returns the distance of y from the sample, in circumradii of the star there.
template <int K>
double ClearanceOf(const double* y, const Stars<K>& stars) {
  std::pair<double, std::uint32_t> nearest;
  if (stars.sample().Nearest(y, 1, &nearest) == 0) return INFINITY;
  double norm2 = 0;
  for (int sector = 0; sector < stars.sample().sectors().Count(nearest.second); ++sector)
    norm2 = std::max(norm2, stars.cell(nearest.second, sector).max_norm2());
  return std::sqrt(nearest.first / norm2);
}

// Whether a point inside of M may be inserted at y. Most answers that were not used were for a
// face, and lie on it: there a point that is on no wall would be in a star of either side.
template <int K>
bool IsClearOfFaces(const double* y, const Stars<K>& stars) {
  return !stars.sample().InProtectingBall(y) && !stars.EncroachedBy(y, 0);
}

}  // namespace

void SparePoints::Keep(const AnsweredPoints& answers, const std::vector<std::uint8_t>& used) {
  for (Eigen::Index c = 0; c < answers.points.cols(); ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    const auto i = static_cast<std::size_t>(c);
    if (!answers.answered[i] || used[i] || answers.Beyond(c)) continue;
    known_.points.insert(known_.points.end(), answers.points.col(c).begin(),
                         answers.points.col(c).end());
    KeepEnd(answers, c);
  }
}

void SparePoints::KeepClearances(const AnsweredPoints& answers, std::size_t most) {
  if (!answers.labels.empty()) return;  // a wall that is not live may be anywhere
  const auto walls = static_cast<int>(answers.clearances.rows());
  for (Eigen::Index c = 0; c < answers.clearances.cols(); ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    const auto i = static_cast<std::size_t>(c);
    if (answers.found[i])
      known_.clear.Note(answers.points.col(c).data(), static_cast<int>(d_),
                        answers.clearances.col(c).data(), walls, answers.walls[i]);
  }
  known_.clear.KeepNewest(most, d_);
}

void SparePoints::KeepEnd(const AnsweredPoints& answers, Eigen::Index c) {
  const auto i = static_cast<std::size_t>(c);
  if (answers.conormals.size() == 0 || !answers.found[i] || CountWalls(answers.walls[i]) != 1)
    return;
  const auto d = static_cast<Eigen::Index>(d_), k = answers.tangents.rows() / d;
  const Eigen::VectorXd tangents = answers.tangents.col(c);
  const Eigen::VectorXd conormal =
      tangents.reshaped(d, k) * Eigen::VectorXd(answers.conormals.col(c).head(k));
  known_.ends.Add(answers.points.col(c).data(), std::countr_zero(answers.walls[i]), conormal.data(),
                  static_cast<int>(d_),
                  answers.labels.empty()
                      ? std::pair(0, 1)
                      : answers.labels.Sides(answers.walls[i], answers.SignsOf(c)));
}

template <int K>
std::vector<double> SparePoints::Uncovered(const Stars<K>& stars) const {
  return ParallelGather<double>(known_.points.size() / d_, [&](std::size_t i, auto* uncovered) {
    const double* y = known_.points.data() + i * d_;
    if (ClearanceOf(y, stars) > kCoverageShare) uncovered->insert(uncovered->end(), y, y + d_);
  });
}

template <int K>
Eigen::MatrixXd SparePoints::Choose(const std::vector<double>& points, const Stars<K>& stars,
                                    double epsilon) {
  if (chosen_ == kMostChosen) return {};
  std::vector<const double*> chosen;
  for (std::size_t at = 0; at < points.size(); at += d_) {
    CheckInterruption(at);
    const double* y = points.data() + at;
    if (!IsClearOfFaces(y, stars)) continue;
    std::pair<double, std::uint32_t> nearest;
    stars.sample().Nearest(y, 1, &nearest);
    const double apart = std::min(epsilon, std::sqrt(nearest.first) / 2);
    if (std::none_of(chosen.begin(), chosen.end(), [&](const double* other) {
          return Distance(y, other, stars.sample().d()) < apart;
        }))
      chosen.push_back(y);
  }
  chosen_ += !chosen.empty();
  Eigen::MatrixXd all(stars.sample().d(), static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i)
    std::copy_n(chosen[i], d_, all.col(static_cast<Eigen::Index>(i)).data());
  return all;
}

PlannedPoints SparePoints::ChooseOnWalls(const PointsOnWalls& points, double epsilon) {
  PlannedPoints chosen;
  if (points.walls.empty() || chosen_ == kMostChosen) return chosen;
  ++chosen_;
  std::vector<const double*> at;
  for (std::size_t i = 0; i < points.walls.size(); ++i) {
    CheckInterruption(i);
    const double* y = points.points.data() + i * d_;
    bool is_near = false;
    for (std::size_t j = 0; j < at.size() && !is_near; ++j)
      is_near =
          chosen.walls[j] == points.walls[i] && Distance(y, at[j], static_cast<int>(d_)) < epsilon;
    if (is_near) continue;
    at.push_back(y);
    chosen.walls.push_back(points.walls[i]);
  }
  const auto d = static_cast<Eigen::Index>(d_);
  chosen.points.resize(d, static_cast<Eigen::Index>(at.size()));
  for (std::size_t i = 0; i < at.size(); ++i)
    chosen.points.col(static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::VectorXd>(at[i], d);
  return chosen;
}

#define STELLATE_EACH(K)                                                                       \
  template std::vector<double> SparePoints::Uncovered<K>(const Stars<K>&) const;               \
  template Eigen::MatrixXd SparePoints::Choose<K>(const std::vector<double>&, const Stars<K>&, \
                                                  double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
