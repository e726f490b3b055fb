#include "core/certificate/evidence/undeclared_boundary_check.h"

#include <algorithm>
#include <cmath>

#include "core/base/message.h"
#include "core/certificate/findings.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMostPlaces = 32;
constexpr double kLongestStep = 0.05;  // of the mesh size
// Inside M both steps go equally far; at a boundary the step back into M goes as far, if it is
// along M at all.
constexpr double kComesBack = 0.5;  // of the step back
constexpr double kAlong = 0.25;     // of its length
// Steps must be this number of position errors long.
constexpr double kErrorsInStep = 10;

}  // namespace

void UndeclaredBoundaryCheck::Add(const Eigen::VectorXd& y, const Eigen::VectorXd& along,
                                  double distance) {
  const double length = along.norm();
  if (!HasTangentialOffset(length, distance)) return;
  places_.push_back(
      {y, along / length, std::min(length / 2, kLongestStep * size_), length / distance});
}

Eigen::MatrixXd UndeclaredBoundaryCheck::Questions(double position_error) {
  asked_ = std::move(places_);
  places_.clear();
  std::erase_if(asked_,
                [&](const Place& l) { return !(l.length > kErrorsInStep * position_error); });
  std::stable_sort(asked_.begin(), asked_.end(),
                   [](const Place& a, const Place& b) { return a.share > b.share; });
  if (asked_.size() > kMostPlaces) asked_.resize(kMostPlaces);
  if (asked_.empty()) return {};
  Eigen::MatrixXd points(asked_.front().y.size(), 2 * static_cast<Eigen::Index>(asked_.size()));
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    const Eigen::VectorXd step = asked_[i].length * asked_[i].direction;
    points.col(2 * static_cast<Eigen::Index>(i)) = asked_[i].y + step;
    points.col(2 * static_cast<Eigen::Index>(i) + 1) = asked_[i].y - step;
  }
  return points;
}

std::string UndeclaredBoundaryCheck::Judge(const AnswerBlock& answer, double position_error) const {
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    const Place& place = asked_[i];
    const auto gone = [&](std::size_t j) {
      return std::abs(
          place.direction.dot(answer.points.col(static_cast<Eigen::Index>(j)) - place.y));
    };
    if (!answer.found.empty() && !(answer.found[2 * i] && answer.found[2 * i + 1])) continue;
    const double over = gone(2 * i) + position_error, back = gone(2 * i + 1);
    if (over >= kComesBack * back || back < kAlong * place.length) continue;
    return Message("the manifold ends, or has a sharp edge, at its point ", NamePoint(place.y),
                   ": the query that led there was not straight above it, and a step of ",
                   Brief(place.length),
                   " along it comes back, while a step the other way does not");
  }
  return {};
}

}  // namespace stellate::core
