#include "core/examination/laws.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/examination/constants.h"

namespace stellate::core::examination {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const char* CodeOf(OracleFault::Kind kind) {
  switch (kind) {
    case OracleFault::Kind::kShape:
      return "WRONG_SHAPE";
    case OracleFault::Kind::kNotFinite:
      return "NOT_FINITE";
    case OracleFault::Kind::kInexact:
      return "INEXACT";
    case OracleFault::Kind::kTouchesZero:
      return "TOUCHES_ZERO";
    case OracleFault::Kind::kDerivative:
      return "WRONG_DERIVATIVE";
    case OracleFault::Kind::kRaised:
      break;
  }
  return "RAISED";
}

// What a client calls the method that answers a block.
std::string MethodOf(const QueryBlock& block) {
  if (block.kind == QueryKind::kIntersectFlat) return "intersect_flat";
  return block.face != 0 ? "face_point" : "closest_point";
}

std::vector<Index> FoundIn(const Answered& answered) {
  Indices kept;
  for (Index j = 0; j < answered.points.cols(); ++j)
    if (answered.found[j]) kept.push_back(j);
  return kept;
}

}  // namespace

Laws::Laws(Specification spec, std::optional<double> epsilon)
    : epsilon_(epsilon), probe_(std::move(spec)), task_(ObeyAll()) {
  task_.Begin();
  Settle();
}

std::shared_ptr<const QueryBatch> Laws::NextBatch() { return batch_; }

Status Laws::Absorb(const Answers& answers, double seconds) {
  if (batch_ == nullptr || answers.blocks.size() != 1) {
    return {StatusCode::kFailedPrecondition,
            "answers to one block are taken, while there is a batch to answer"};
  }
  const QueryBlock& block = batch_->blocks.front();
  const AnswerBlock& given = answers.blocks.front();
  Status status = CheckAnswerShape(probe_.spec(), block, 0, given);
  if (status.ok() && given.size() != block.size()) {
    status = {StatusCode::kOracleShape, "the batch wants an answer for each of its queries"};
  }
  if (!status.ok()) return status;
  // Arrays may be missing where nothing was found.
  AnswerBlock whole =
      AnswerBlock::Shape(probe_.k(), probe_.walls(), block, static_cast<Index>(block.size()));
  whole.Put(0, given);
  batch_ = nullptr;
  probe_.box.Reply(std::move(whole), seconds);
  Settle();
  return Status::Ok();
}

void Laws::Fail(const OracleFault& fault) {
  if (is_over_ || batch_ == nullptr) return;
  const QueryBlock& block = batch_->blocks.front();
  Add(CodeOf(fault.kind), {{"method", MethodOf(block)}, {"n", block.size()}, {"what", fault.what}});
  Conclude();
}

void Laws::Settle() {
  if (const QueryBlock* const block = probe_.box.waiting()) {
    QueryBatch batch;
    batch.round = ++round_;
    batch.blocks.push_back(*block);
    batch_ = std::make_shared<const QueryBatch>(std::move(batch));
  }
  report_.samples = static_cast<std::uint64_t>(probe_.points.cols());
  report_.queries = probe_.queries;
  if (!task_.is_over()) return;
  try {
    task_.result();
  } catch (Stop& stop) {
    Add(std::move(stop.finding));
  }
  Conclude();
}

void Laws::Conclude() {
  is_over_ = true;
  batch_ = nullptr;
  std::stable_sort(report_.findings.begin(), report_.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.severity < b.severity; });
}

void Laws::Add(Finding finding) {
  if (!Has(finding.code)) report_.findings.push_back(std::move(finding));
}

bool Laws::Has(const std::string& code) const {
  return std::any_of(report_.findings.begin(), report_.findings.end(),
                     [&code](const Finding& f) { return f.code == code; });
}

double Laws::Near() const {
  return epsilon_ ? std::min(*report_.reach, kNearEpsilons * *epsilon_) : *report_.reach;
}

double Laws::Slack() const { return kSlack * probe_.size; }

Task<> Laws::ObeyAll() {
  co_await PointsAreFound();
  co_await AnswersRepeat();
  co_await AnswersStay();
  // Far from M a nearer answer is a warning only: solvers find local minima there.
  NoneSeenIsNearer(probe_.starts, probe_.points, "NOT_CLOSEST_FAR");
  if (!Has("NOT_DETERMINISTIC") && !Has("NOT_IDEMPOTENT")) {
    co_await TangentsAreFound();
    JudgeRanks(kWrongRanks);
    co_await TangentsAreRight();
    co_await SizesAreLengths();
    if (!Has("WRONG_DIMENSION")) co_await ObeyNearby();
    // Samples on an edge are odd ones out, which the smoothness test names better.
    if (!Has("ROUGH")) JudgeRanks(kFewWrongRanks);
    co_await PiecesAreCounted();
  }
  co_await SpeedIsMeasured();
}

// The laws that go by M's tangent spaces. What fills space has no directions normal to M.
Task<> Laws::ObeyNearby() {
  if (probe_.walls() > 0) {
    walls_.emplace(probe_, [this](Finding finding) { Add(std::move(finding)); });
    co_await walls_->Obey();
  }
  co_await ReachIsEstimated();
  if (probe_.fills_space()) co_return;
  co_await NearPointsComeBack();
  co_await SurfaceIsSmooth();
  co_await FlatsAreMet();
}

Task<> Laws::PointsAreFound() {
  const int k = probe_.k(), d = probe_.d();
  const bool is_possible = 1 <= k && (k < d || (k == d && probe_.walls() > 0));
  if (!is_possible) throw Stop{MakeFinding("BAD_DIMENSIONS", {{"k", k}, {"d", d}})};
  const MatrixXd all = probe_.StartingPoints();
  if (all.cols() == 0) throw Stop{MakeFinding("NO_WHEREABOUTS", {{"d", d}})};
  const Answered answered = co_await probe_.Closest(all);
  const Indices kept = FoundIn(answered);
  Index first_lost = 0;
  while (first_lost < all.cols() && answered.found[first_lost]) ++first_lost;
  const Index lost = all.cols() - std::ssize(kept);
  if (kept.empty()) {
    throw Stop{MakeFinding("NOTHING_FOUND", {{"n", all.cols()}, {"query", VectorXd(all.col(0))}})};
  }
  if (lost > std::ssize(kept)) {
    Add("MOSTLY_NOT_FOUND",
        {{"lost", lost}, {"n", all.cols()}, {"query", VectorXd(all.col(first_lost))}});
  }
  probe_.starts = Take(all, kept);
  probe_.points = Take(answered.points, kept);
  probe_.size = (probe_.points.rowwise().maxCoeff() - probe_.points.rowwise().minCoeff()).norm();
  JudgeBox();
}

void Laws::JudgeBox() {
  const auto& box = probe_.spec().bounding_box;
  if (!box || probe_.walls() > 0) return;
  const double slack = kBoxSlack * (box->upper - box->lower).norm();
  for (const auto& p : probe_.points.colwise()) {
    if ((p.array() < box->lower.array() - slack).any() ||
        (p.array() > box->upper.array() + slack).any()) {
      return Add("OUTSIDE_BOX", {{"answer", VectorXd(p)}});
    }
  }
}

// The same again; then in another order and in parts, some of them single.
Task<> Laws::AnswersRepeat() {
  const MatrixXd x = probe_.starts;
  const Answered first = co_await probe_.Closest(x);
  const Answered second = co_await probe_.Closest(x);
  MatrixXd apart(x.rows(), x.cols());
  for (Index at = 0, width = 1; at < x.cols(); at += width) {
    width = at < kSingleQueries ? 1 : std::min<Index>(x.cols() - at, kPartQueries);
    const Answered part = co_await probe_.Closest(x.middleCols(at, width).rowwise().reverse());
    apart.middleCols(at, width) = part.points.rowwise().reverse();
  }
  for (Index j = 0; j < x.cols(); ++j) {
    const bool repeats = first.points.col(j) == second.points.col(j);
    const double off = (first.points.col(j) - apart.col(j)).norm();
    if (repeats && off <= kBatchSlack * probe_.size) continue;
    const VectorXd other = (repeats ? apart : second.points).col(j);
    Add(repeats ? "BATCH_DEPENDENT" : "NOT_DETERMINISTIC",
        {{"query", VectorXd(x.col(j))},
         {"answer", VectorXd(first.points.col(j))},
         {"other", other}});
    co_return;
  }
}

Task<> Laws::AnswersStay() {
  const Answered again = co_await probe_.Closest(probe_.points);
  VectorXd moved = (again.points - probe_.points).colwise().norm();
  for (Index j = 0; j < moved.size(); ++j)
    if (!again.found[j]) moved[j] = kInfinity;
  Index worst = 0;
  const double most = moved.maxCoeff(&worst);
  const VectorXd query = probe_.points.col(worst);
  if (most > Slack()) {
    Add("NOT_IDEMPOTENT",
        {{"query", query}, {"answer", VectorXd(again.points.col(worst))}, {"moved", most}});
  } else if (most > kNoise * probe_.size) {
    Add("NOISY", {{"query", query}, {"moved", most}});
  }
}

void Laws::NoneSeenIsNearer(const MatrixXd& x, const MatrixXd& y, const char* code) {
  for (Index j = 0; j < x.cols(); ++j) {
    const double own = (x.col(j) - y.col(j)).norm();
    Index nearest = 0;
    const double seen =
        std::sqrt((probe_.points.colwise() - x.col(j)).colwise().squaredNorm().minCoeff(&nearest));
    if (own <= seen + Slack()) continue;
    return Add(code, {{"query", VectorXd(x.col(j))},
                      {"answer", VectorXd(y.col(j))},
                      {"own", own},
                      {"other", VectorXd(probe_.points.col(nearest))},
                      {"seen", seen}});
  }
}

// Off M along a normal by a part of the reach, and back: closest, and at right angles.
Task<> Laws::NearPointsComeBack() {
  for (const double share : kOffsets) {
    const double away = share * Near();
    const MatrixXd all = probe_.some + away * probe_.Normals(probe_.moved_tangents);
    const Answered back = co_await probe_.Closest(all);
    Indices kept;
    for (Index j = 0; j < all.cols(); ++j)
      if (back.found[j] && (all.col(j) - back.points.col(j)).norm() > kLeastOffset * away)
        kept.push_back(j);
    const MatrixXd x = Take(all, kept), y = Take(back.points, kept);
    NoneSeenIsNearer(x, y, "NOT_CLOSEST");
    const std::vector<Basis> tangents = co_await probe_.TangentsAt(y);
    JudgeAngles(x, y, tangents);
  }
}

void Laws::JudgeAngles(const MatrixXd& x, const MatrixXd& y, const std::vector<Basis>& tangents) {
  for (Index j = 0; j < x.cols(); ++j) {
    const VectorXd v = (x.col(j) - y.col(j)).normalized();
    const double degrees =
        DegreesOfSine((tangents[static_cast<std::size_t>(j)].transpose() * v).norm());
    if (degrees <= kToleratedDegrees) continue;
    return Add(
        "NOT_NORMAL",
        {{"query", VectorXd(x.col(j))}, {"answer", VectorXd(y.col(j))}, {"degrees", degrees}});
  }
}

Task<> Laws::TangentsAreFound() {
  probe_.some = Take(probe_.points, Spread(probe_.points.cols(), kSome));
  Probe::Moved moved = co_await probe_.Differential(probe_.some);
  probe_.moved_tangents = std::move(moved.bases);
  probe_.ranks = std::move(moved.ranks);
}

void Laws::JudgeRanks(double share) {
  std::vector<std::size_t> wrong;
  for (std::size_t j = 0; j < probe_.ranks.size(); ++j)
    if (probe_.ranks[j] != probe_.k()) wrong.push_back(j);
  if (static_cast<double>(wrong.size()) <= share * static_cast<double>(probe_.ranks.size())) return;
  const VectorXd query = probe_.some.col(static_cast<Index>(wrong[0]));
  Add("WRONG_DIMENSION", {{"query", query}, {"rank", probe_.ranks[wrong[0]]}, {"k", probe_.k()}});
}

Task<> Laws::TangentsAreRight() {
  if (!probe_.spec().oracle.tangent_basis) {
    Add("NO_TANGENTS", {{"extra", 2 * probe_.k()}});
    co_return;
  }
  const std::vector<Basis> given = co_await probe_.GivenTangents(probe_.some);
  const Basis identity = Basis::Identity(probe_.k(), probe_.k());
  probe_.trusts_given = true;
  for (std::size_t j = 0; j < given.size(); ++j) {
    const VectorXd query = probe_.some.col(static_cast<Index>(j));
    const double off = (given[j].transpose() * given[j] - identity).cwiseAbs().maxCoeff();
    if (off > kOrthonormalSlack) {
      Add("TANGENT_NOT_ORTHONORMAL", {{"query", query}, {"off", off}});
      probe_.trusts_given = false;
    }
    if (off > kUsableTangents || probe_.ranks[j] != probe_.k() || Has("WRONG_DIMENSION")) continue;
    const double degrees = Turn(OrthonormalBasis(given[j], probe_.k()), probe_.moved_tangents[j]);
    if (degrees > kToleratedDegrees) {
      Add("TANGENT_WRONG", {{"query", query}, {"degrees", degrees}});
      probe_.trusts_given = false;
    }
  }
}

Task<> Laws::SizesAreLengths() {
  if (!probe_.spec().oracle.local_size) co_return;
  const VectorXd sizes = co_await probe_.GivenSizes(probe_.some);
  for (Index j = 0; j < sizes.size(); ++j) {
    if (sizes[j] >= kMinLength && sizes[j] <= kMaxLength) continue;
    Add("SIZE_WRONG", {{"query", VectorXd(probe_.some.col(j))}, {"size", sizes[j]}});
    co_return;
  }
  for (Index j = 0; j < sizes.size(); ++j) {
    const VectorXd query = probe_.some.col(j);
    const VectorXd alone = co_await probe_.GivenSizes(query);
    if (std::abs(alone[0] - sizes[j]) <= kSizeSlack * sizes[j]) continue;
    Add("SIZE_CHANGES", {{"query", query}, {"size", sizes[j]}, {"other", alone[0]}});
    co_return;
  }
}

Task<> Laws::ReachIsEstimated() {
  double reach = kInfinity;
  const double shortest = kShortestWay * probe_.size;
  const std::vector<Basis>& tangents = probe_.moved_tangents;
  for (Index j = 0; j < probe_.some.cols(); ++j) {
    for (const auto& q : probe_.points.colwise()) {
      const VectorXd v = q - probe_.some.col(j);
      reach = std::min(reach, ReachFrom(v, tangents[static_cast<std::size_t>(j)], shortest));
    }
  }
  const double step = kReachStep * std::min(reach, probe_.size);
  for (int a = 0; a < probe_.k(); ++a) {
    MatrixXd x = probe_.some;
    for (Index j = 0; j < x.cols(); ++j)
      x.col(j) += step * tangents[static_cast<std::size_t>(j)].col(a);
    const Answered q = co_await probe_.Closest(std::move(x));
    for (Index j = 0; j < q.points.cols(); ++j) {
      if (!q.found[j]) continue;
      const VectorXd v = q.points.col(j) - probe_.some.col(j);
      reach = std::min(reach, ReachFrom(v, tangents[static_cast<std::size_t>(j)], shortest));
    }
  }
  if (walls_) {
    const double boundary = co_await walls_->Reach();
    reach = std::min({reach, boundary, kFlatReach * probe_.size});
  }
  report_.reach = reach;
  const double advised = kSafeRatio * reach;
  Add("REACH", {{"reach", reach}, {"advised", advised}});
  if (epsilon_ && *epsilon_ > advised) {
    Add("COARSE_EPSILON", {{"epsilon", *epsilon_},
                           {"ratio", *epsilon_ / reach},
                           {"reach", reach},
                           {"advised", advised}});
  }
}

// Where tangents turn between two points, halving the way halves the turn: not at corners. Ways
// start at the neighbouring samples that turn most; of two halves the one that turns more is kept.
Task<> Laws::SurfaceIsSmooth() {
  const auto pairs = co_await probe_.MostTurnedNeighbours();
  Indices from, to;
  for (const auto& [i, j] : pairs) {
    from.push_back(i);
    to.push_back(j);
  }
  MatrixXd a = Take(probe_.points, from), b = Take(probe_.points, to);
  std::vector<double> turned;
  for (int halving = 0; halving < kHalvings; ++halving) {
    const Answered middle = co_await probe_.Closest((a + b) / 2);
    const std::vector<Basis> at_a = co_await probe_.TangentsAt(a);
    const std::vector<Basis> at_b = co_await probe_.TangentsAt(b);
    const std::vector<Basis> between = co_await probe_.TangentsAt(middle.points);
    const Indices kept = FoundIn(middle);
    turned.clear();
    for (const Index j : kept) {
      const auto i = static_cast<std::size_t>(j);
      const double first = Turn(at_a[i], between[i]), second = Turn(between[i], at_b[i]);
      (first >= second ? b : a).col(j) = middle.points.col(j);
      turned.push_back(std::max(first, second));
    }
    a = Take(a, kept);
    b = Take(b, kept);
    if (kept.empty()) co_return;
  }
  for (Index j = 0; j < a.cols(); ++j) {
    const double degrees = turned[static_cast<std::size_t>(j)];
    const double length = (a.col(j) - b.col(j)).norm();
    if (degrees <= kCornerDegrees || length >= kCornerLength * probe_.size) continue;
    Add("ROUGH", {{"query", VectorXd(a.col(j))}, {"degrees", degrees}, {"length", length}});
    co_return;
  }
}

// Each flat goes through a sample, where it meets M, and perhaps nearer to its centre.
Task<> Laws::FlatsAreMet() {
  if (!probe_.spec().oracle.intersect_flat) co_return;
  for (const double tilt : kTilts) {
    std::vector<Basis> bases;
    for (const Basis& tangent : probe_.moved_tangents) {
      const Basis tilted = probe_.RandomMatrix(tilt / std::sqrt(static_cast<double>(probe_.d())));
      bases.push_back(OrthonormalBasis(tangent + tilted, probe_.k()));
    }
    MatrixXd centers = probe_.some + kFlatOffset * Near() * probe_.Normals(bases);
    co_await Meet(std::move(centers), std::move(bases));
  }
}

Task<> Laws::Meet(MatrixXd centers, std::vector<Basis> bases) {
  const VectorXd radii = VectorXd::Constant(centers.cols(), kFlatRadius * Near());
  const Answered met = co_await probe_.Intersect(centers, bases, radii);
  const Answered again = co_await probe_.Closest(met.points);
  const VectorXd shorter = kShortRadius * JudgeMet(centers, bases, radii, met, again);
  const Answered met_shorter = co_await probe_.Intersect(centers, bases, shorter);
  JudgeRadii(centers, shorter, met_shorter);
}

// Returns how far from its centre each flat was met.
VectorXd Laws::JudgeMet(const MatrixXd& centers, const std::vector<Basis>& bases,
                        const VectorXd& radii, const Answered& met, const Answered& again) {
  VectorXd distances(centers.cols());
  for (Index j = 0; j < centers.cols(); ++j) {
    const VectorXd query = centers.col(j), there = probe_.some.col(j), m = met.points.col(j);
    const double seen = (there - query).norm();
    distances[j] = seen;
    if (!met.found[j]) {
      Add("FLAT_MISSED", {{"query", query}, {"answer", there}, {"radius", radii[j]}});
      continue;
    }
    const double own = (m - query).norm();
    const double off = (bases[static_cast<std::size_t>(j)].transpose() * (m - query)).norm();
    const double moved = again.found[j] ? (again.points.col(j) - m).norm() : kInfinity;
    distances[j] = own;
    if (off > Slack()) Add("FLAT_OFF", {{"query", query}, {"answer", m}, {"off", off}});
    if (moved > Slack()) {
      Add("FLAT_OFF_MANIFOLD", {{"query", query}, {"answer", m}, {"moved", moved}});
    }
    if (own > seen + Slack()) {
      Add("FLAT_NOT_NEAREST",
          {{"query", query}, {"answer", m}, {"other", there}, {"seen", seen}, {"own", own}});
    }
  }
  return distances;
}

void Laws::JudgeRadii(const MatrixXd& centers, const VectorXd& radii, const Answered& met) {
  for (Index j = 0; j < centers.cols(); ++j) {
    const double own = (met.points.col(j) - centers.col(j)).norm();
    if (!met.found[j] || own <= radii[j] + Slack()) continue;
    return Add("FLAT_OUTSIDE_RADIUS", {{"query", VectorXd(centers.col(j))},
                                       {"answer", VectorXd(met.points.col(j))},
                                       {"own", own},
                                       {"radius", radii[j]}});
  }
}

Task<> Laws::PiecesAreCounted() {
  report_.pieces = co_await probe_.Pieces();
  Add("PIECES", {{"n", probe_.points.cols()}, {"pieces", *report_.pieces}});
}

// The least time that one batch took, of as many as fit.
Task<> Laws::SpeedIsMeasured() {
  const std::uint64_t asked = probe_.queries;
  for (const int batch : kBatches) {
    if (batch > kMostTimedNumbers / probe_.d()) break;
    MatrixXd x(probe_.d(), batch);
    for (int j = 0; j < batch; ++j) x.col(j) = probe_.starts.col(j % probe_.starts.cols());
    double best = kInfinity, spent = 0;
    while (spent < kSpeedSeconds) {
      const double seconds = co_await probe_.Time(x);
      if (!(seconds > 0)) {  // nobody measures
        probe_.queries = asked;
        co_return;
      }
      best = std::min(best, seconds);
      spent += seconds;
    }
    report_.rates.push_back({batch, batch / best});
    if (best > 10 * kSpeedSeconds) break;
  }
  probe_.queries = asked;  // these were no examination
  JudgeSpeed();
}

void Laws::JudgeSpeed() {
  if (report_.rates.empty()) return;
  double best = 0;
  for (const BatchRate& rate : report_.rates) best = std::max(best, rate.queries_per_second);
  const auto good = std::find_if(
      report_.rates.begin(), report_.rates.end(),
      [&](const BatchRate& rate) { return rate.queries_per_second >= kGoodRate * best; });
  report_.best_batch = good->batch;
  const auto shown = [](double rate) { return static_cast<Index>(ToTwoDigits(rate)); };
  Add("SPEED", {{"rate", shown(best)},
                {"batch", report_.best_batch},
                {"single", shown(report_.rates.front().queries_per_second)}});
  if (best < kSlowRate) {
    Add("SLOW", {{"rate", shown(best)},
                 {"batch", report_.best_batch},
                 {"minutes", kMeshQueries / best / 60}});
  }
}

}  // namespace stellate::core::examination
