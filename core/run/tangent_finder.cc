#include "core/run/tangent_finder.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

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

// A normal is read off an answer that is at least `step` away: the oracle's error turns it no more
// than it turns differences. It is compared with them from so many steps on, where it is the more
// exact one of the two.
constexpr double kTellingSteps = 10;
// They agree if their angle is no larger than directions may be wrong by without harm (its sine).
constexpr double kAgreement = 0.03;
// So many have to agree, in places that the seed chose, before one is read unseen; some more are
// taken, since some may fail.
constexpr std::uint64_t kComparisons = 24;
constexpr std::ptrdiff_t kTaken = 32;
// A normal that is turned farther from its guess (its sine) is not read: on meshes that are fine
// enough for a certificate few are, and on a crease or an undeclared boundary most.
constexpr double kMostOffGuess = 0.3;

// Estimates are wrong by about as much as slopes miss the fit, and as the fit is off what is
// orthogonal to the normal (a sine): a few hundredths do no harm.
constexpr double kMostOff = 0.03;
// Where a lattice grows points lie on one side alone. It bears rough tangent spaces, which Refine
// makes four to ten times as exact.
constexpr double kMostOffInRing = 0.12;
constexpr double kMostMisfitInRing = 0.06;
// Where no more than this share of a ring has no estimate, these points are left out: the rules ask
// for others there when there are points all around.
constexpr double kLeftOut = 0.5;

// Returns an orthonormal basis of what is orthogonal to `normal`, d x k, k = d - 1: one near to the
// guess, if there is one.
Eigen::MatrixXd BasisAcross(Eigen::VectorXd normal, const double* guess) {
  const Eigen::Index d = normal.size();
  normal /= normal.norm();
  if (guess == nullptr) return OrthonormalBasis(normal, d).rightCols(d - 1);
  const Eigen::Map<const Eigen::MatrixXd> near(guess, d, d - 1);
  return OrthonormalBasis(near - normal * (normal.transpose() * near), d - 1);
}

}  // namespace

TangentFinder::TangentFinder(int k, int d, double step, std::uint64_t seed, double most_error)
    : k_(k),
      d_(d),
      step_(step),
      most_error_(most_error),
      seed_(seed),
      fits_(std::make_unique<TangentFits>(k, d)) {}

bool TangentFinder::trusts_normals() const { return reads_normals() && agreed_ >= kComparisons; }

void TangentFinder::Start(Points points) {
  of_ = std::move(points);
  const Eigen::Index count = of_.points.cols();
  tangents_ = Eigen::MatrixXd::Zero(k_ * d_, count);
  ok_.assign(static_cast<std::size_t>(count), 0);
  errors_.assign(static_cast<std::size_t>(count), 0);
  waiting_.clear();
  if (estimates()) return StartEstimates();
  std::vector<Eigen::Index> open, readable;
  for (Eigen::Index i = 0; i < count; ++i) (CanRead(i) ? readable : open).push_back(i);
  if (trusts_normals()) {
    Read(readable);
    return Begin(std::move(open));
  }
  std::ptrdiff_t taken = 0;
  for (const Eigen::Index i : readable) {
    const bool takes = taken < kTaken && Length(i) >= kTellingSteps * StepAt(i);
    taken += takes;
    (takes ? open : waiting_).push_back(i);
  }
  if (agreed_ + static_cast<std::uint64_t>(taken) < kComparisons)
    for (const Eigen::Index i : std::exchange(waiting_, {})) open.push_back(i);
  std::sort(open.begin(), open.end());
  Begin(std::move(open));
}

// Takes differences where there is no estimate to rely on.
void TangentFinder::StartEstimates() {
  if (reads_normals()) fits_->Look(of_.points);
  if (trusts_normals() && of_.asked.cols() > 0)
    ParallelFor(ok_.size(),
                [&](std::size_t i) { ok_[i] = Estimate(static_cast<Eigen::Index>(i)); });
  std::vector<Eigen::Index> open;
  for (std::size_t i = 0; i < ok_.size(); ++i)
    if (!ok_[i]) open.push_back(static_cast<Eigen::Index>(i));
  if (of_.may_leave_out &&
      static_cast<double>(open.size()) <= kLeftOut * static_cast<double>(ok_.size()))
    open.clear();
  Begin(std::move(open));
}

// Fits a tangent space to the points near by, and turns it by what the normal that its answer tells
// is off. That is a second estimate, in one direction: where the two differ, or the points fit
// poorly, neither is relied on.
bool TangentFinder::Estimate(Eigen::Index point) {
  if (!CanRead(point)) return false;
  const double* const guess = of_.guesses[static_cast<std::size_t>(point)];
  if (guess == nullptr) return false;
  const Eigen::MatrixXd basis =
      OrthonormalBasis(Eigen::Map<const Eigen::MatrixXd>(guess, d_, k_), k_);
  const std::optional<TangentFits::Fit> fit = fits_->At(point, basis.data());
  const bool rough = of_.may_leave_out;
  if (!fit || fit->misfit > (rough ? kMostMisfitInRing : kMostOff)) return false;
  const Eigen::VectorXd normal = (of_.asked.col(point) - of_.points.col(point)).normalized();
  const Eigen::VectorXd off = fit->tangents.transpose() * normal;
  if (off.norm() > (rough ? kMostOffInRing : kMostOff)) return false;
  Eigen::Map<Eigen::MatrixXd>(tangents_.col(point).data(), d_, k_) =
      OrthonormalBasis(fit->tangents - normal * off.transpose(), k_);
  return true;
}

void TangentFinder::Begin(std::vector<Eigen::Index> open) {
  again_ = false;
  guessed_ = std::all_of(open.begin(), open.end(), [&](Eigen::Index i) {
    return of_.guesses[static_cast<std::size_t>(i)] != nullptr;
  });
  batch_ = open;
  open_ = std::move(open);
  if (!open_.empty())
    Ask();
  else if (waiting_.empty() && reads_normals() && estimates())
    Remember();
}

// Keeps what was found for the fits to come.
void TangentFinder::Remember() {
  using enum TangentFits::Knowledge;
  Eigen::MatrixXd normals = Eigen::MatrixXd::Zero(d_, of_.points.cols());
  std::vector<TangentFits::Knowledge> known(ok_.size(), kNone);
  for (Eigen::Index i = 0; i < normals.cols(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (ok_[at]) known[at] = errors_[at] > 0 ? kExact : kEstimate;
    if (of_.asked.cols() > 0 && Length(i) >= StepAt(i))
      normals.col(i) = (of_.asked.col(i) - of_.points.col(i)).normalized();
  }
  fits_->Know(of_.points, tangents_, normals, known);
}

void TangentFinder::Refine(const Eigen::MatrixXd& points, Eigen::MatrixXd* tangents) {
  if (reads_normals() && estimates()) fits_->Refine(points, kMostOff, tangents);
}

// Whether an answer is far enough from its query, and not turned too far from its guess.
bool TangentFinder::CanRead(Eigen::Index point) const {
  if (!reads_normals() || of_.asked.cols() == 0) return false;
  const double* const guess = of_.guesses[static_cast<std::size_t>(point)];
  const Eigen::VectorXd normal = of_.asked.col(point) - of_.points.col(point);
  const double length = normal.norm();
  if (!(length >= StepAt(point))) return false;
  if (guess == nullptr) return true;
  const Eigen::Map<const Eigen::MatrixXd> basis(guess, d_, k_);
  return (basis.transpose() * normal).norm() <= kMostOffGuess * length;
}

void TangentFinder::Read(const std::vector<Eigen::Index>& points) {
  ParallelFor(points.size(), [&](std::size_t i) {
    const Eigen::Index point = points[i];
    Eigen::Map<Eigen::MatrixXd>(tangents_.col(point).data(), d_, k_) = BasisAcross(
        of_.asked.col(point) - of_.points.col(point), of_.guesses[static_cast<std::size_t>(point)]);
    ok_[static_cast<std::size_t>(point)] = 1;
  });
}

// Compares normals with the differences that were taken.
void TangentFinder::Compare() {
  if (!reads_normals() || of_.asked.cols() == 0) return;
  for (const Eigen::Index point : batch_) {
    if (!ok_[static_cast<std::size_t>(point)]) continue;
    const Eigen::VectorXd normal = of_.asked.col(point) - of_.points.col(point);
    const double length = normal.norm();
    if (!(length >= kTellingSteps * StepAt(point))) continue;
    const Eigen::Map<const Eigen::MatrixXd> basis(tangents_.col(point).data(), d_, k_);
    if ((basis.transpose() * normal).norm() <= kAgreement * length)
      ++agreed_;
    else
      has_disagreed_ = true;
  }
}

// Differences of a batch have been taken.
void TangentFinder::GoOn() {
  Compare();
  std::vector<Eigen::Index> rest = std::exchange(waiting_, {});
  if (!trusts_normals()) return Begin(std::move(rest));
  Read(rest);
  Begin({});
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
        const double* guess = of_.guesses[static_cast<std::size_t>(point)] + j * d_;
        u = Eigen::Map<const Eigen::VectorXd>(guess, d_);
      } else {
        for (int a = 0; a < d_; ++a) u[a] = random.NearlyNormal();
        u.normalize();
      }
      block_.points.col((i * m + j) * 2) = of_.points.col(point) + StepAt(point) * u;
      block_.points.col((i * m + j) * 2 + 1) = of_.points.col(point) - StepAt(point) * u;
    }
  }
}

std::vector<QueryBlock> TangentFinder::Questions() {
  std::vector<QueryBlock> blocks;
  if (!open_.empty()) blocks.push_back(std::exchange(block_, {}));
  return blocks;
}

void TangentFinder::Absorb(const std::vector<AnswerBlock>& blocks) {
  const AnswerBlock& answers = blocks.front();
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
    for (const Eigen::Index point : batch_) {
      if (!(errors_[static_cast<std::size_t>(point)] > most_error_)) continue;
      of_.guesses[static_cast<std::size_t>(point)] = tangents_.col(point).data();
      open.push_back(point);
    }
  }
  open_ = std::move(open);
  if (!open_.empty()) return Ask();
  for (const Eigen::Index point : batch_)
    error_length_ = std::max(error_length_, errors_[static_cast<std::size_t>(point)]);
  GoOn();
}

}  // namespace stellate::core
