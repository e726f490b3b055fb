#include "stellate/doctor.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "examination.h"

namespace stellate {
namespace doctor {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kBatches[] = {1, 10, 100, 1000, 10'000};
constexpr double kSpeedSeconds = 0.03;  // for each batch size
constexpr double kSlowRate = 2000;

// The least time that one call took, of as many as fit.
template <typename Call>
double SecondsOf(const Call& call) {
  double best = std::numeric_limits<double>::infinity();
  const Clock::time_point begin = Clock::now();
  for (Clock::time_point from = begin; from - begin < std::chrono::duration<double>(kSpeedSeconds);
       from = Clock::now()) {
    call();
    best = std::min(best, std::chrono::duration<double>(Clock::now() - from).count());
  }
  return std::max(best, 1e-9);
}

// To two digits, as it is measured.
std::int64_t Rounded(double rate) {
  const double unit = std::pow(10, std::floor(std::log10(std::max(rate, 1.0))) - 1);
  return std::llround(std::round(rate / unit) * unit);
}

}  // namespace

void Examination::Add(Finding finding) {
  if (!Has(finding.code)) report_.findings.push_back(std::move(finding));
}

CheckReport Examination::Run() {
  try {
    ObeyLaws();
  } catch (Stop& stop) {
    Add(std::move(stop.finding));
  }
  std::stable_sort(report_.findings.begin(), report_.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.severity < b.severity; });
  report_.samples = static_cast<std::uint64_t>(probe_.points.cols());
  report_.queries = probe_.queries;
  return std::move(report_);
}

void Examination::ObeyLaws() {
  probe_.FindPoints([this](Finding finding) { Add(std::move(finding)); });
  AnswersRepeat();
  AnswersStay();
  // Far from M a nearer answer is a warning only: solvers find local minima there.
  NoneSeenIsNearer(probe_.starts, probe_.points, "NOT_CLOSEST_FAR");
  if (Has("NOT_DETERMINISTIC") || Has("NOT_IDEMPOTENT")) {
    return MeasureSpeed();  // the rest needs points of M
  }
  probe_.FindTangents();
  DimensionIsRight(0.5);
  TangentsAreRight();
  SizesAreLengths();
  if (!Has("WRONG_DIMENSION")) {
    EstimateReach();
    NearPointsComeBack();
    IsSmooth();
    FlatsAreMet();
  }
  if (!Has("ROUGH")) DimensionIsRight(0.05);
  report_.pieces = probe_.Pieces();
  Add("PIECES",
      {{"n", static_cast<std::int64_t>(probe_.points.cols())}, {"pieces", *report_.pieces}});
  MeasureSpeed();
}

void Examination::MeasureSpeed() {
  const std::uint64_t asked = probe_.queries;
  double best = 0;
  for (const int batch : kBatches) {
    Eigen::MatrixXd x(probe_.d(), batch);
    for (int j = 0; j < batch; ++j) x.col(j) = probe_.starts.col(j % probe_.starts.cols());
    const double seconds = SecondsOf([&] { probe_.Closest(x); });
    report_.rates.emplace_back(batch, batch / seconds);
    best = std::max(best, batch / seconds);
    if (seconds > 10 * kSpeedSeconds) break;
  }
  probe_.queries = asked;  // that was no examination
  for (const auto& [batch, rate] : report_.rates) {
    report_.best_batch = batch;
    if (rate >= 0.9 * best) break;
  }
  Add("SPEED", {{"rate", Rounded(best)},
                {"batch", report_.best_batch},
                {"single", Rounded(report_.rates.front().second)}});
  if (best < kSlowRate) {
    Add("SLOW",
        {{"rate", Rounded(best)}, {"batch", report_.best_batch}, {"minutes", 1e5 / best / 60}});
  }
}

}  // namespace doctor

CheckReport Check(Oracle& oracle, const CheckOptions& options) {
  return doctor::Examination(oracle, options).Run();
}

}  // namespace stellate
