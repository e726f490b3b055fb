#include "core/reconstruction/fitted_cloud.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/power.h"
#include "core/reconstruction/neighbour_search.h"
#include "core/reconstruction/quadric_fit.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// Neighbours, in coefficients of a quadric: for its tangent space alone, and to average noise.
constexpr int kFittedOver = 2;
constexpr int SmoothedOver(int k) { return k >= 3 ? 4 : 6; }
// Points with less noise than this, in spacings, are better as they are.
constexpr double kQuiet = 0.03;
// A quadric's misfit to a curved manifold grows with the third power of the neighbours' distance,
// noise does not grow: more than this from one fit to the next is no noise.
constexpr double kMisfit = 1.6;

double VolumeOfBall(int k) {
  return k == 1 ? 2 : k == 2 ? std::numbers::pi : 4 * std::numbers::pi / 3;
}

// Returns the k-th root of x, 0 < x, by Newton's method.
double Root(double x, int k) {
  double root = std::max(x, 1.0);
  for (double next = root;; root = next) {
    next = root - (root - x / Power(root, k - 1)) / k;
    if (!(next < root)) return root;
  }
}

double MedianOf(std::vector<double>* values) {
  if (values->empty()) return 0;
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

class CloudFitter {
 public:
  CloudFitter(std::vector<double> points, const FitRequest& request) : request_(request) {
    cloud_.k = request.k;
    cloud_.d = request.d;
    cloud_.size = static_cast<std::uint32_t>(points.size() / static_cast<std::size_t>(request.d));
    cloud_.positions = std::move(points);
    const std::size_t n = cloud_.size;
    cloud_.tangents.resize(n * numbers());
    for (auto* values : {&cloud_.spacing, &cloud_.nearest, &cloud_.noise, &cloud_.height})
      values->resize(n);
    cloud_.kurtosis.assign(n, 3);
    cloud_.extents.resize(n);
    cloud_.smoothed.resize(n);
  }

  FittedCloud Run(FunctionRef<void(double)> done) {
    FitAll();
    done(0.4);
    ChooseNoisy();
    if (cloud_.any_smoothed) {
      std::vector<double> moved = SmoothOnce();
      done(0.7);
      if (cloud_.any_smoothed) SmoothAgain(moved);
    }
    for (auto* values : {&cloud_.noise, &cloud_.spacing, &cloud_.kurtosis})
      for (int pass = 0; pass < 2; ++pass) Even(values);
    done(1);
    return std::move(cloud_);
  }

 private:
  std::size_t numbers() const {
    return static_cast<std::size_t>(cloud_.k) * static_cast<std::size_t>(cloud_.d);
  }
  int Count(int times) const {
    return std::min<int>(times * QuadricFit::Terms(cloud_.k) + 1, static_cast<int>(cloud_.size));
  }
  QuadricFit NewFit() const { return {cloud_.k, cloud_.d}; }

  // So many points in a ball of R^k with their mean spacing have this one.
  double SpacingOf(Neighbours near) const {
    const double points = static_cast<double>(near.size()) - 1;
    return Root(VolumeOfBall(cloud_.k) / points, cloud_.k) *
           std::max(std::sqrt(near.back().first), kMinLength);
  }

  void FitAll() {
    const NeighbourSearch search(cloud_.positions, cloud_.d);
    const int count = Count(kFittedOver);
    cloud_.near_count = static_cast<std::uint32_t>(count);
    cloud_.smoothed_count = static_cast<std::uint32_t>(Count(SmoothedOver(cloud_.k)));
    cloud_.near.resize(std::size_t{cloud_.size} * cloud_.near_count);
    search.ForEach(
        count, [&] { return NewFit(); },
        [&](std::uint32_t p, Neighbours near, QuadricFit& fit) {
          const bool given = !request_.tangents.empty();
          fit.Fit(search.points().data(), near,
                  given ? request_.tangents.data() + p * numbers() : nullptr,
                  QuadricFit::Wanted::kDeviation);
          cloud_.nearest[p] = std::sqrt(near[1].first);
          cloud_.spacing[p] = SpacingOf(near);
          for (std::size_t i = 0; i < near.size(); ++i)
            cloud_.near[std::size_t{p} * cloud_.near_count + i] = near[i].second;
          Take(p, fit);
          cloud_.noise[p] = fit.deviation();
          cloud_.extents[p] = static_cast<std::uint8_t>(std::min(fit.extent(), 255));
        });
  }

  void Take(std::uint32_t p, const QuadricFit& fit) {
    std::copy(fit.tangent().begin(), fit.tangent().end(), cloud_.tangents.data() + p * numbers());
    cloud_.height[p] = fit.step().norm();
  }

  // Marks the points to be smoothed.
  void ChooseNoisy() {
    if (cloud_.size < static_cast<std::uint32_t>(Count(SmoothedOver(cloud_.k)))) return;
    if (request_.noise && *request_.noise == 0) return;
    ParallelFor(cloud_.size, [&](std::uint32_t p) {
      cloud_.smoothed[p] =
          MedianAround(p, [&](std::uint32_t q) {
            return (request_.noise ? *request_.noise : cloud_.noise[q]) / cloud_.spacing[q];
          }) >= kQuiet;
    });
    NoteSmoothed();
  }
  void NoteSmoothed() {
    const auto& marks = cloud_.smoothed;
    cloud_.any_smoothed = std::find(marks.begin(), marks.end(), 1) != marks.end();
  }
  template <typename Value>
  double MedianAround(std::uint32_t p, const Value& value) const {
    thread_local std::vector<double> values;
    values.clear();
    for (const std::uint32_t q : cloud_.Near(p)) values.push_back(value(q));
    return MedianOf(&values);
  }

  // Whether the deviations from quadrics through more neighbours show that these are too many.
  bool IsMisfit(const std::vector<double>& noise) const {
    std::vector<double> ratios;
    for (std::uint32_t p = 0; p < cloud_.size; ++p)
      if (cloud_.smoothed[p] && cloud_.noise[p] > 0) ratios.push_back(noise[p] / cloud_.noise[p]);
    return MedianOf(&ratios) > kMisfit;
  }

  // Returns copies of the points, the marked ones moved to quadrics through more neighbours. Clears
  // the marks if these are too many.
  std::vector<double> SmoothOnce() {
    std::vector<double> noise = cloud_.noise, kurtosis(cloud_.size, 3.0), height = cloud_.height;
    std::vector<double> spacing = cloud_.spacing;
    const auto note = [&](std::uint32_t p, Neighbours near, const QuadricFit& fit) {
      spacing[p] = SpacingOf(near);
      noise[p] = fit.deviation();
      kurtosis[p] = fit.kurtosis();
      height[p] = fit.step().norm();
    };
    std::vector<double> moved = Smooth(cloud_.positions, QuadricFit::Wanted::kAll, note);
    cloud_.misfits = !request_.noise && IsMisfit(noise);
    if (cloud_.misfits) {
      std::fill(cloud_.smoothed.begin(), cloud_.smoothed.end(), std::uint8_t{0});
    } else {
      for (std::uint32_t p = 0; p < cloud_.size; ++p) {
        if (!cloud_.smoothed[p]) continue;
        cloud_.spacing[p] = spacing[p];
        cloud_.noise[p] = noise[p];
        cloud_.height[p] = height[p];
        cloud_.kurtosis[p] = kurtosis[p];
      }
    }
    NoteSmoothed();
    return moved;
  }

  // Of few neighbours each is known but roughly: takes the medians over them.
  void Even(std::vector<double>* values) const {
    std::vector<double> medians(values->size());
    ParallelFor(cloud_.size, [&](std::uint32_t p) {
      medians[p] = MedianAround(p, [&](std::uint32_t q) { return (*values)[q]; });
    });
    *values = std::move(medians);
  }

  void SmoothAgain(const std::vector<double>& moved) {
    const auto take = [&](std::uint32_t p, Neighbours, const QuadricFit& fit) {
      std::copy(fit.tangent().begin(), fit.tangent().end(), cloud_.tangents.data() + p * numbers());
    };
    cloud_.positions = Smooth(moved, QuadricFit::Wanted::kQuadric, take);
  }

  // Returns copies of `points`, the marked ones moved to quadrics. Calls visit(p, neighbours, fit)
  // for each of these.
  template <typename Visit>
  std::vector<double> Smooth(const std::vector<double>& points, QuadricFit::Wanted wanted,
                             const Visit& visit) const {
    const NeighbourSearch search(points, cloud_.d);
    std::vector<double> moved = points;
    search.ForEach(
        Count(SmoothedOver(cloud_.k)), [&] { return NewFit(); },
        [&](std::uint32_t p, Neighbours near, QuadricFit& fit) {
          if (!cloud_.smoothed[p]) return;
          fit.Fit(search.points().data(), near, nullptr, wanted);
          double* const copy = moved.data() + std::size_t{p} * static_cast<std::size_t>(cloud_.d);
          for (int i = 0; i < cloud_.d; ++i) copy[i] += fit.step()[i];
          visit(p, near, fit);
        });
    return moved;
  }

  FitRequest request_;
  FittedCloud cloud_;
};

}  // namespace

double Median(std::vector<double> values) { return MedianOf(&values); }

FittedCloud FitCloud(std::vector<double> points, const FitRequest& request,
                     FunctionRef<void(double)> done) {
  return CloudFitter(std::move(points), request).Run(done);
}

}  // namespace stellate::core
