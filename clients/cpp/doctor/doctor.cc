#include "stellate/doctor.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <map>
#include <sstream>
#include <string>

#include "doctor/examination.h"
#include "shared/doctor.h"

namespace stellate {
namespace doctor {
namespace {

using Clock = std::chrono::steady_clock;

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
  using Law = void (Examination::*)();
  static const std::map<std::string, Law> by_name = {
      {"answers_repeat", &Examination::AnswersRepeat},
      {"answers_stay", &Examination::AnswersStay},
      {"answers_are_closest", &Examination::AnswersAreClosest},
      {"equations_have_rank", &Examination::EquationsHaveRank},
      {"dimension_is_right", &Examination::DimensionIsRight},
      {"tangents_are_right", &Examination::TangentsAreRight},
      {"sizes_are_lengths", &Examination::SizesAreLengths},
      {"walls_are_right", &Examination::WallsAreRight},
      {"reach_is_estimated", &Examination::EstimateReach},
      {"near_points_come_back", &Examination::NearPointsComeBack},
      {"surface_is_smooth", &Examination::IsSmooth},
      {"flats_are_met", &Examination::FlatsAreMet},
      {"few_ranks_are_wrong", &Examination::FewRanksAreWrong},
      {"pieces_are_counted", &Examination::CountPieces},
      {"speed_is_measured", &Examination::MeasureSpeed},
  };
  probe_.FindPoints([this](Finding finding) { Add(std::move(finding)); });
  for (const char* const line : kLaws) {
    std::istringstream words(line);
    std::string name, code;
    words >> name >> code;  // and "unless"
    const bool of_normals =
        std::find(std::begin(kOfNormals), std::end(kOfNormals), name) != std::end(kOfNormals);
    bool obey = !(of_normals && probe_.fills_space());
    while (words >> code) obey = obey && !Has(code);
    if (obey) (this->*by_name.at(name))();
  }
}

void Examination::CountPieces() {
  report_.pieces = probe_.Pieces();
  Add("PIECES",
      {{"n", static_cast<std::int64_t>(probe_.points.cols())}, {"pieces", *report_.pieces}});
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
    if (rate >= kGoodRate * best) break;
  }
  Add("SPEED", {{"rate", Rounded(best)},
                {"batch", report_.best_batch},
                {"single", Rounded(report_.rates.front().second)}});
  if (best < kSlowRate) {
    Add("SLOW", {{"rate", Rounded(best)},
                 {"batch", report_.best_batch},
                 {"minutes", kMeshQueries / best / 60}});
  }
}

}  // namespace doctor

CheckReport Check(Oracle& oracle, const CheckOptions& options) {
  return doctor::Examination(oracle, options).Run();
}

}  // namespace stellate
