#include "core/run/tangent_finder.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/random.h"

namespace stellate::core {
namespace {

// The derivative keeps cos(angle) of each direction of a guess: below this the guess is turned too
// far (73 degrees) for a reliable span.
constexpr double kLeastKept = 0.3;
// Random directions lose most of their length if d is large; but none of the k found directions may
// be much weaker than another.
constexpr double kLeastRatio = 1e-3;
// The derivative has rank k: further singular values are curvature times step, or noise.
constexpr double kMostBeyond = 0.3;

}  // namespace

TangentFinder::TangentFinder(int k, int d, double step, std::uint64_t seed, double most_error)
    : k_(k), d_(d), step_(step), most_error_(most_error), seed_(seed) {}

void TangentFinder::Start(const Eigen::MatrixXd& points, std::vector<const double*> guesses,
                          std::vector<double> shares) {
  points_ = points;
  guesses_ = std::move(guesses);
  shares_ = std::move(shares);
  tangents_ = Eigen::MatrixXd::Zero(k_ * d_, points.cols());
  ok_.assign(static_cast<std::size_t>(points.cols()), 0);
  errors_.assign(static_cast<std::size_t>(points.cols()), 0);
  again_ = false;
  open_.clear();
  guessed_ = true;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    open_.push_back(i);
    guessed_ = guessed_ && guesses_[static_cast<std::size_t>(i)] != nullptr;
  }
  Ask();
}

void TangentFinder::Ask() {
  const int m = guessed_ ? k_ : std::min(k_ + 4, d_);
  const auto count = static_cast<Eigen::Index>(open_.size());
  directions_.resize(d_, count * m);
  block_.kind = QueryKind::kClosestPoint;
  block_.points.resize(d_, count * m * 2);
  for (Eigen::Index i = 0; i < count; ++i) {
    CheckInterruption(static_cast<std::size_t>(i));
    const Eigen::Index point = open_[static_cast<std::size_t>(i)];
    Random random(seed_, static_cast<std::uint64_t>(point));
    for (int j = 0; j < m; ++j) {
      auto u = directions_.col(i * m + j);
      if (guessed_) {
        const double* guess = guesses_[static_cast<std::size_t>(point)] + j * d_;
        u = Eigen::Map<const Eigen::VectorXd>(guess, d_);
      } else {
        for (int a = 0; a < d_; ++a) u[a] = random.NearlyNormal();
        u.normalize();
      }
      block_.points.col((i * m + j) * 2) = points_.col(point) + StepAt(point) * u;
      block_.points.col((i * m + j) * 2 + 1) = points_.col(point) - StepAt(point) * u;
    }
  }
}

void TangentFinder::Absorb(const AnswerBlock& answers) {
  const int m = guessed_ ? k_ : std::min(k_ + 4, d_);
  ParallelFor(open_.size(), [&](std::size_t i) {
    const Eigen::Index point = open_[i];
    Eigen::MatrixXd derivative(d_, m);
    bool complete = true;
    for (int j = 0; j < m; ++j) {
      const auto q = (static_cast<Eigen::Index>(i) * m + j) * 2;
      if (!answers.found.empty())
        complete = complete && answers.found[static_cast<std::size_t>(q)] &&
                   answers.found[static_cast<std::size_t>(q) + 1];
      derivative.col(j) = (answers.points.col(q) - answers.points.col(q + 1)) / (2 * StepAt(point));
    }
    if (!complete) return;
    const auto [directions, s] = LeftSingular(derivative);
    const bool spans = guessed_ ? s[k_ - 1] > kLeastKept : s[k_ - 1] > kLeastRatio * s[0];
    const bool flat = m <= k_ || s[k_] < kMostBeyond * s[k_ - 1];
    if (spans && flat) {
      for (int a = 0; a < k_; ++a) tangents_.col(point).segment(a * d_, d_) = directions.col(a);
      ok_[static_cast<std::size_t>(point)] = 1;
      errors_[static_cast<std::size_t>(point)] =
          std::sqrt(static_cast<double>(m)) * 2 * StepAt(point) / s[k_ - 1];
    }
  });
  AskMore();
}

// Replaces guesses that were turned too far by random directions, and queries tangents of poor
// accuracy again, along themselves.
void TangentFinder::AskMore() {
  std::vector<Eigen::Index> open;
  if (guessed_ && !again_) {
    for (const Eigen::Index point : open_)
      if (!ok_[static_cast<std::size_t>(point)]) open.push_back(point);
    guessed_ = false;
  }
  if (open.empty() && !again_) {
    again_ = guessed_ = true;
    for (Eigen::Index point = 0; point < points_.cols(); ++point) {
      if (!(errors_[static_cast<std::size_t>(point)] > most_error_)) continue;
      guesses_[static_cast<std::size_t>(point)] = tangents_.col(point).data();
      open.push_back(point);
    }
  }
  open_ = std::move(open);
  if (!open_.empty()) return Ask();
  for (const double error : errors_) error_length_ = std::max(error_length_, error);
}

}  // namespace stellate::core
