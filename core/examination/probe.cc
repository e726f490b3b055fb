#include "core/examination/probe.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <string>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/base/message.h"
#include "core/examination/constants.h"
#include "core/examination/words.h"

namespace stellate::core::examination {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Pairs = std::vector<std::pair<Index, Index>>;
using ByCoordinate = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

[[noreturn]] void NotFinite(const std::string& what) {
  throw Stop{MakeFinding("NOT_FINITE", {{"what", what}})};
}

// Whether squares of these, and their sums, are numbers.
template <typename Numbers>
bool AreUsable(const Numbers& numbers) {
  return (numbers.array().abs() <= kMaxLength).all();
}

// Looks at one array of an answer, where something was found.
void CheckFinite(const char* method, const char* array, const MatrixXd& x, const Found& found,
                 const MatrixXd& numbers) {
  for (Index j = 0; j < numbers.cols(); ++j) {
    if (!found[j] || AreUsable(numbers.col(j))) continue;
    NotFinite(Message(method, " returned ", array, " ", Show({"it", VectorXd(numbers.col(j))}),
                      " for the query ", Show({"it", VectorXd(x.col(j))}), ", number ", j, " of ",
                      numbers.cols()));
  }
}

// An orthonormal basis in the place of each one that there is none for.
void FillBases(const Found& found, int d, int k, MatrixXd* bases) {
  for (Index j = 0; j < bases->cols(); ++j)
    if (!found[j]) Eigen::Map<ByCoordinate>(bases->col(j).data(), d, k) = MatrixXd::Identity(d, k);
}

std::vector<Basis> BasesOf(const MatrixXd& by_coordinate, int d, int k) {
  std::vector<Basis> bases;
  for (Index j = 0; j < by_coordinate.cols(); ++j)
    bases.emplace_back(Eigen::Map<const ByCoordinate>(by_coordinate.col(j).data(), d, k));
  return bases;
}

}  // namespace

Mailbox::Asking Probe::Ask(QueryBlock block) {
  // Only answers that differ by more than numbers can hold lead to such queries.
  if (!AreUsable(block.points))
    NotFinite("the points that closest_point returned are too far apart");
  queries += static_cast<std::uint64_t>(block.size());
  return box.Ask(std::move(block));
}

Answered Probe::Checked(const char* method, const MatrixXd& x, AnswerBlock* answer) const {
  if (x.cols() == 0) return {MatrixXd(d(), 0), Found(0)};
  Answered checked{std::move(answer->points), Found(x.cols())};
  for (Index j = 0; j < x.cols(); ++j)
    checked.found[j] = answer->found[static_cast<std::size_t>(j)] != 0;
  CheckFinite(method, "the point", x, checked.found, checked.points);
  CheckFinite(method, "the tangent basis", x, checked.found, answer->tangents);
  CheckFinite(method, "the clearances", x, checked.found, answer->clearances);
  CheckFinite(method, "the conormals", x, checked.found, answer->conormals);
  for (Index j = 0; j < x.cols(); ++j)
    if (!checked.found[j]) checked.points.col(j) = x.col(j);
  return checked;
}

Task<Answered> Probe::Closest(MatrixXd x) {
  QueryBlock block;
  block.points = x;
  AnswerBlock answer = co_await Ask(std::move(block));
  co_return Checked("closest_point", x, &answer);
}

Task<Answered> Probe::Intersect(MatrixXd centers, std::vector<Basis> bases, VectorXd radii) {
  QueryBlock block;
  block.kind = QueryKind::kIntersectFlat;
  block.points = centers;
  block.radii = std::move(radii);
  block.bases.resize(Index{d()} * k(), centers.cols());
  for (Index j = 0; j < centers.cols(); ++j)
    Eigen::Map<ByCoordinate>(block.bases.col(j).data(), d(), k()) =
        bases[static_cast<std::size_t>(j)];
  AnswerBlock answer = co_await Ask(std::move(block));
  co_return Checked("intersect_flat", centers, &answer);
}

Task<std::vector<Basis>> Probe::GivenTangents(MatrixXd at) {
  QueryBlock block;
  block.points = at;
  block.want.tangents = true;
  AnswerBlock answer = co_await Ask(std::move(block));
  const Answered checked = Checked("tangent_basis", at, &answer);
  FillBases(checked.found, d(), k(), &answer.tangents);
  co_return BasesOf(answer.tangents, d(), k());
}

Task<VectorXd> Probe::GivenSizes(MatrixXd at) {
  QueryBlock block;
  block.points = at;
  block.want.sizes = true;
  AnswerBlock answer = co_await Ask(std::move(block));
  Checked("local_size", at, &answer);
  co_return std::move(answer.sizes);
}

Task<Answered> Probe::FacePoints(MatrixXd x, WallSet face) {
  QueryBlock block;
  block.points = x;
  block.face = face;
  block.want.tangents = block.want.clearances = true;
  AnswerBlock answer = co_await Ask(std::move(block));
  co_return Checked("face_point", x, &answer);
}

Task<FaceAnswers> Probe::OnFace(MatrixXd at, WallSet face) {
  QueryBlock block;
  block.points = at;
  block.face = face;
  block.want.tangents = block.want.clearances = true;
  AnswerBlock answer = co_await Ask(std::move(block));
  const Answered checked = Checked(face == 0 ? "clearances" : "conormals", at, &answer);
  for (Index j = 0; j < at.cols(); ++j) {
    if (checked.found[j]) continue;
    answer.clearances.col(j).setZero();
    if (face != 0) answer.conormals.col(j).setZero();
  }
  FaceAnswers there;
  if (at.cols() == 0) {
    there.clearances.resize(walls(), 0);
    there.conormals.resize(d(), 0);
    co_return there;
  }
  if (face != 0) there.conormals = answer.conormals.topRows(d());
  if (CountWalls(face) > 1) there.others = answer.conormals.middleRows(d(), d());
  there.clearances = std::move(answer.clearances);
  co_return there;
}

Task<MatrixXd> Probe::Clearances(MatrixXd at) {
  FaceAnswers there = co_await OnFace(std::move(at), 0);
  co_return std::move(there.clearances);
}

Task<double> Probe::Time(MatrixXd x) {
  QueryBlock block;
  block.points = std::move(x);
  co_await Ask(std::move(block));
  co_return box.seconds();
}

MatrixXd Probe::RandomMatrix(double entry) {
  MatrixXd m(d(), k());
  for (double& value : m.reshaped()) value = entry * (2 * random_.Uniform() - 1);
  return m;
}

MatrixXd Probe::RandomUnits(Index count) {
  MatrixXd v(d(), count);
  for (double& value : v.reshaped()) value = random_.NearlyNormal();
  return v.colwise().normalized();
}

MatrixXd Probe::StartingPoints() {
  MatrixXd all(d(), 0);
  const auto append = [&all](const MatrixXd& more) {
    const Index old = all.cols();
    all.conservativeResize(Eigen::NoChange, old + more.cols());
    all.rightCols(more.cols()) = more;
  };
  const auto& box_of_m = spec_.bounding_box;
  const MatrixXd& seeds = spec_.seeds;
  if (seeds.cols() > 0 && seeds.rows() == d() && AreUsable(seeds)) {
    append(seeds.leftCols(std::min<Index>(seeds.cols(), kStarts)));
    if (!box_of_m) {
      // About them, so that there is more than one point to look at.
      double spread = (seeds.rowwise().maxCoeff() - seeds.rowwise().minCoeff()).norm();
      if (spread == 0) spread = seeds.col(0).norm();
      if (spread == 0) spread = 1;
      MatrixXd near = kSeedSpread * spread * RandomUnits(kStarts);
      for (Index j = 0; j < kStarts; ++j) near.col(j) += seeds.col(j % seeds.cols());
      append(near);
    }
  }
  if (box_of_m && box_of_m->lower.size() == d() && box_of_m->upper.size() == d() &&
      (box_of_m->lower.array() < box_of_m->upper.array()).all() && AreUsable(box_of_m->lower) &&
      AreUsable(box_of_m->upper)) {
    MatrixXd inside(d(), kStarts);
    const VectorXd sides = box_of_m->upper - box_of_m->lower;
    for (Index j = 0; j < kStarts; ++j)
      for (int i = 0; i < d(); ++i)
        inside(i, j) = box_of_m->lower[i] + sides[i] * random_.Uniform();
    append(inside);
  }
  return all;
}

Task<Probe::Moved> Probe::Differential(MatrixXd at) {
  const int count = std::min(d(), std::max(kMaxDirections, 2 * k() + 6));
  const MatrixXd directions = count < d() ? OrthonormalBasis(RandomUnits(count), count)
                                          : MatrixXd(MatrixXd::Identity(d(), d()));
  const double h = kDifferentialStep * size;
  MatrixXd ends(d(), 2 * count * at.cols());
  for (Index j = 0; j < at.cols(); ++j) {
    ends.middleCols(2 * count * j, count) = (h * directions).colwise() + at.col(j);
    ends.middleCols(2 * count * j + count, count) = (-h * directions).colwise() + at.col(j);
  }
  const Answered images = co_await Closest(std::move(ends));
  Moved moved;
  for (Index j = 0; j < at.cols(); ++j) {
    const MatrixXd ahead = images.points.middleCols(2 * count * j, count),
                   behind = images.points.middleCols(2 * count * j + count, count);
    MatrixXd slope = (ahead - behind) / (2 * h);
    if (!slope.allFinite()) slope.setZero();  // M is seen as one point: nothing moves
    const SingularColumns singular = LeftSingular(slope);
    const VectorXd& s = singular.values;
    moved.bases.emplace_back(singular.vectors.leftCols(k()));
    moved.ranks.push_back(
        s[0] > kLeastSingular ? static_cast<int>((s.array() > kRankShare * s[0]).count()) : 0);
  }
  co_return moved;
}

Task<std::vector<Basis>> Probe::TangentsAt(MatrixXd at) {
  if (trusts_given) {
    std::vector<Basis> given = co_await GivenTangents(std::move(at));
    co_return given;
  }
  Moved moved = co_await Differential(std::move(at));
  co_return std::move(moved.bases);
}

MatrixXd Probe::Normals(const std::vector<Basis>& bases) {
  MatrixXd v = RandomUnits(static_cast<Index>(bases.size()));
  for (Index j = 0; j < v.cols(); ++j) {
    const Basis& t = bases[static_cast<std::size_t>(j)];
    for (int twice = 0; twice < 2; ++twice) {
      v.col(j) -= t * (t.transpose() * v.col(j)).eval();
      v.col(j).normalize();
    }
  }
  return v;
}

// Pairs a < b, one of which is among the nearest of the other's.
Pairs Probe::Neighbours(int count) const {
  Pairs pairs;
  const Index n = points.cols();
  Indices order(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) {
    const VectorXd distance = (points.colwise() - points.col(i)).colwise().squaredNorm();
    std::iota(order.begin(), order.end(), Index{0});
    const auto last = order.begin() + std::min<Index>(count + 1, n);
    std::partial_sort(order.begin(), last, order.end(), [&](Index a, Index b) {
      return std::pair(distance[a], a) < std::pair(distance[b], b);
    });
    for (auto it = order.begin(); it != last; ++it)
      if (*it != i) pairs.emplace_back(std::min(i, *it), std::max(i, *it));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

Task<Pairs> Probe::MostTurnedNeighbours() {
  const Pairs pairs = Neighbours(kNeighbours);
  const std::vector<Basis> tangents = co_await TangentsAt(points);
  std::vector<std::pair<double, std::size_t>> turned;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Basis &a = tangents[static_cast<std::size_t>(pairs[i].first)],
                &b = tangents[static_cast<std::size_t>(pairs[i].second)];
    turned.emplace_back(-Turn(a, b), i);
  }
  std::sort(turned.begin(), turned.end());
  Pairs most;
  for (std::size_t i = 0; i < turned.size() && std::ssize(most) < kSome; ++i)
    most.push_back(pairs[turned[i].second]);
  co_return most;
}

Task<int> Probe::Pieces() {
  const Pairs pairs = Neighbours(kPieceNeighbours);
  MatrixXd ways(d(), std::ssize(pairs) * (kPieceSteps - 1));
  Index at = 0;
  for (const auto& [a, b] : pairs)
    for (int i = 1; i < kPieceSteps; ++i)
      ways.col(at++) = points.col(a) + (points.col(b) - points.col(a)) * i / kPieceSteps;
  const Answered way = co_await Closest(std::move(ways));
  Indices label(static_cast<std::size_t>(points.cols()));
  std::iota(label.begin(), label.end(), Index{0});
  const auto root = [&label](Index i) {
    while (label[static_cast<std::size_t>(i)] != i) i = label[static_cast<std::size_t>(i)];
    return i;
  };
  at = 0;
  for (const auto& [a, b] : pairs) {
    const double leap = kLeap * (points.col(a) - points.col(b)).norm();
    VectorXd last = points.col(a);
    bool is_walked = true;
    for (int i = 1; i < kPieceSteps; ++i, ++at) {
      is_walked = is_walked && way.found[at] && (way.points.col(at) - last).norm() <= leap;
      last = way.points.col(at);
    }
    is_walked = is_walked && (points.col(b) - last).norm() <= leap;
    if (is_walked) label[static_cast<std::size_t>(root(b))] = root(a);
  }
  int pieces = 0;
  for (Index i = 0; i < points.cols(); ++i) pieces += root(i) == i ? 1 : 0;
  co_return pieces;
}

Indices Spread(Index columns, Index count) {
  const Index stride = std::max<Index>(1, columns / count);
  Indices chosen;
  for (Index j = 0; j < columns && std::ssize(chosen) < count; j += stride) chosen.push_back(j);
  return chosen;
}

double Median(const VectorXd& values) {
  if (values.size() == 0) return 0;
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  return (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]) / 2;
}

double DegreesOfSine(double sine) {
  return std::asin(std::min(1.0, sine)) * 180 / std::numbers::pi;
}

double DegreesOfCosine(double cosine) {
  return std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi;
}

double Turn(const Basis& a, const Basis& b) {
  const MatrixXd rest = b - a * (a.transpose() * b);
  return rest.allFinite() ? DegreesOfSine(LeftSingular(rest).values[0]) : 90;
}

double ReachFrom(const VectorXd& v, const Basis& tangent, double shortest) {
  if (!(v.norm() > shortest)) return kInfinity;
  const double off = (v - tangent * (tangent.transpose() * v)).norm();
  return v.squaredNorm() / (2 * std::max(off, kLeastHeight * shortest));
}

}  // namespace stellate::core::examination
