#include "doctor/probe.h"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "doctor/findings.h"
#include "shared/doctor.h"

namespace stellate::doctor {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Pairs = std::vector<std::pair<Eigen::Index, Eigen::Index>>;

// What an oracle throws becomes a finding.
template <typename Ask>
auto Guarded(const char* method, Eigen::Index count, const Ask& ask) {
  std::string what = "an exception that is no std::exception";
  try {
    return ask();
  } catch (const OracleError& error) {
    const bool inexact = error.reason() == "ORACLE_PRECISION";
    throw Stop{MakeFinding(inexact ? "INEXACT" : "WRONG_SHAPE", {{"what", error.what()}})};
  } catch (const std::exception& error) {
    what = error.what();
  } catch (...) {
  }
  throw Stop{MakeFinding(
      "RAISED",
      {{"method", std::string(method)}, {"n", static_cast<std::int64_t>(count)}, {"what", what}})};
}

[[noreturn]] void WrongShape(const std::string& what) {
  throw Stop{MakeFinding("WRONG_SHAPE", {{"what", what}})};
}

std::string Extent(Eigen::Index rows, Eigen::Index columns) {
  return std::to_string(rows) + " x " + std::to_string(columns);
}

}  // namespace

Eigen::MatrixXd Orthonormal(const Eigen::MatrixXd& columns) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(columns).householderQ() *
         Eigen::MatrixXd::Identity(columns.rows(), columns.cols());
}

Probe::Probe(Oracle& oracle, std::uint64_t random_seed)
    : oracle_(oracle),
      k_(oracle.dimension()),
      d_(oracle.ambient_dimension()),
      walls_(oracle.walls()),
      gives_tangents_(oracle.has_tangent_basis()),
      random_(random_seed) {}

Answered Probe::Checked(const char* method, const Answer& answer, Eigen::Index count) const {
  if (answer.points.rows() != d_ || answer.points.cols() != count) {
    WrongShape(std::string(method) + " returned points " +
               Extent(answer.points.rows(), answer.points.cols()) + "; wanted are " +
               Extent(d_, count));
  }
  if (!answer.found.empty() && static_cast<Eigen::Index>(answer.found.size()) != count) {
    WrongShape(std::string(method) + " returned " + std::to_string(answer.found.size()) +
               " found flags for " + std::to_string(count) + " questions");
  }
  Answered answered{answer.points, Found::Constant(count, true)};
  for (Eigen::Index j = 0; j < count; ++j) {
    answered.found[j] = answer.IsFound(j);
    if (answered.found[j] && !answer.points.col(j).allFinite()) {
      const std::string what = std::string(method) + " returned " +
                               Show(Eigen::VectorXd(answer.points.col(j))) + " for question " +
                               std::to_string(j) + " of " + std::to_string(count);
      throw Stop{MakeFinding("NOT_FINITE", {{"what", what}})};
    }
  }
  return answered;
}

Answered Probe::Closest(const Eigen::MatrixXd& x) {
  queries += static_cast<std::uint64_t>(x.cols());
  const Answer answer = Guarded("ClosestPoint", x.cols(), [&] { return oracle_.ClosestPoint(x); });
  return Checked("ClosestPoint", answer, x.cols());
}

Answered Probe::Intersect(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases,
                          const Eigen::VectorXd& radii) {
  queries += static_cast<std::uint64_t>(centers.cols());
  Eigen::MatrixXd flat(d_ * k_, centers.cols());
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    Eigen::Map<RowMajor>(flat.col(j).data(), d_, k_) = bases[static_cast<size_t>(j)];
  }
  const Answer answer = Guarded("IntersectFlat", centers.cols(),
                                [&] { return oracle_.IntersectFlat(centers, flat, radii); });
  return Checked("IntersectFlat", answer, centers.cols());
}

std::vector<Basis> Probe::GivenTangents(const Eigen::MatrixXd& at) {
  queries += static_cast<std::uint64_t>(at.cols());
  const Eigen::MatrixXd given =
      Guarded("TangentBasis", at.cols(), [&] { return oracle_.TangentBasis(at); });
  if (given.rows() != d_ * k_ || given.cols() != at.cols()) {
    WrongShape("TangentBasis returned bases " + Extent(given.rows(), given.cols()) +
               "; wanted are " + Extent(d_ * k_, at.cols()));
  }
  std::vector<Basis> bases;
  for (Eigen::Index j = 0; j < at.cols(); ++j) {
    bases.emplace_back(Eigen::Map<const RowMajor>(given.col(j).data(), d_, k_));
    if (!given.col(j).allFinite()) {
      throw Stop{MakeFinding("NOT_FINITE", {{"what",
                                             "TangentBasis returned a basis that is not "
                                             "finite at " +
                                                 Show(Eigen::VectorXd(at.col(j)))}})};
    }
  }
  return bases;
}

Eigen::VectorXd Probe::GivenSizes(const Eigen::MatrixXd& at) {
  queries += static_cast<std::uint64_t>(at.cols());
  Eigen::VectorXd sizes = Guarded("LocalSize", at.cols(), [&] { return oracle_.LocalSize(at); });
  if (sizes.size() != at.cols()) {
    WrongShape("LocalSize returned " + std::to_string(sizes.size()) + " sizes for " +
               std::to_string(at.cols()) + " points");
  }
  return sizes;
}

Answered Probe::FacePoints(const Eigen::MatrixXd& x, const Walls& face) {
  queries += static_cast<std::uint64_t>(x.cols());
  const Answer answer = Guarded("FacePoint", x.cols(), [&] { return oracle_.FacePoint(x, face); });
  return Checked("FacePoint", answer, x.cols());
}

// Finite numbers, `rows` for each point.
Eigen::MatrixXd Probe::Numbers(const char* method, const Eigen::MatrixXd& at, Eigen::Index rows,
                               const std::function<Eigen::MatrixXd()>& ask) {
  queries += static_cast<std::uint64_t>(at.cols());
  Eigen::MatrixXd numbers = Guarded(method, at.cols(), ask);
  if (numbers.rows() != rows || numbers.cols() != at.cols()) {
    WrongShape(std::string(method) + " returned " + Extent(numbers.rows(), numbers.cols()) +
               " numbers; wanted are " + Extent(rows, at.cols()));
  }
  if (!numbers.allFinite()) {
    throw Stop{MakeFinding(
        "NOT_FINITE", {{"what", std::string(method) + " returned numbers that are not finite"}})};
  }
  return numbers;
}

Eigen::MatrixXd Probe::EquationGradients(const Eigen::MatrixXd& at) {
  return Numbers("EquationGradients", at, static_cast<Eigen::Index>(equations()) * d_,
                 [&] { return oracle_.EquationGradients(at); });
}

Eigen::MatrixXd Probe::Clearances(const Eigen::MatrixXd& at) {
  return Numbers("Clearances", at, walls_, [&] { return oracle_.Clearances(at); });
}

Eigen::MatrixXd Probe::Conormals(const Eigen::MatrixXd& at, const Walls& face) {
  const Eigen::Index rows = d_ * std::ssize(face);
  return Numbers("Conormals", at, rows, [&] { return oracle_.Conormals(at, face); });
}

double Probe::Uniform(double low, double high) {
  // The engine's output is fixed by the standard, the distributions' is not.
  return low + (high - low) * std::ldexp(static_cast<double>(random_() >> 11), -53);
}

Eigen::MatrixXd Probe::RandomMatrix(double entry) {
  Eigen::MatrixXd m(d_, k_);
  for (double& value : m.reshaped()) value = Uniform(-entry, entry);
  return m;
}

Eigen::MatrixXd Probe::RandomUnits(Eigen::Index count) {
  Eigen::MatrixXd v(d_, count);
  for (double& value : v.reshaped()) value = Uniform(-1, 1);
  return v.colwise().normalized();
}

Eigen::MatrixXd Probe::StartingPoints() {
  Eigen::MatrixXd starts_found(d_, 0);
  const auto append = [&starts_found](const Eigen::MatrixXd& more) {
    const Eigen::Index old = starts_found.cols();
    starts_found.conservativeResize(Eigen::NoChange, old + more.cols());
    starts_found.rightCols(more.cols()) = more;
  };
  const std::optional<BoundingBox> box = oracle_.bounding_box();
  const Eigen::MatrixXd seeds = oracle_.seeds();
  if (seeds.cols() > 0 && seeds.rows() == d_ && seeds.allFinite()) {
    append(seeds.leftCols(std::min<Eigen::Index>(seeds.cols(), kStarts)));
    if (!box) {
      // About them, so that there is more than one point to look at.
      double spread = (seeds.rowwise().maxCoeff() - seeds.rowwise().minCoeff()).norm();
      if (spread == 0) spread = seeds.col(0).norm();
      if (spread == 0) spread = 1;
      Eigen::MatrixXd near = kSeedSpread * spread * RandomUnits(kStarts);
      for (Eigen::Index j = 0; j < kStarts; ++j) near.col(j) += seeds.col(j % seeds.cols());
      append(near);
    }
  }
  if (box && box->lower.size() == d_ && box->upper.size() == d_ &&
      (box->lower.array() < box->upper.array()).all() && (box->upper - box->lower).allFinite()) {
    Eigen::MatrixXd inside(d_, kStarts);
    for (Eigen::Index j = 0; j < kStarts; ++j) {
      for (int i = 0; i < d_; ++i) inside(i, j) = Uniform(box->lower[i], box->upper[i]);
    }
    append(inside);
  }
  if (starts_found.cols() == 0) throw Stop{MakeFinding("NO_WHEREABOUTS", {{"d", d_}})};
  return starts_found;
}

void Probe::FindPoints(const std::function<void(Finding)>& add) {
  const bool possible = 1 <= k_ && (k_ < d_ || (k_ == d_ && walls_ > 0));
  if (!possible) throw Stop{MakeFinding("BAD_DIMENSIONS", {{"k", k_}, {"d", d_}})};
  const Eigen::MatrixXd all = StartingPoints();
  const Answered answered = Closest(all);
  Indices kept, lost;
  for (Eigen::Index j = 0; j < all.cols(); ++j) (answered.found[j] ? kept : lost).push_back(j);
  const auto count = static_cast<std::int64_t>(all.cols());
  if (kept.empty()) {
    throw Stop{
        MakeFinding("NOTHING_FOUND", {{"n", count}, {"query", Eigen::VectorXd(all.col(0))}})};
  }
  if (lost.size() > kept.size()) {
    add(MakeFinding("MOSTLY_NOT_FOUND", {{"lost", static_cast<std::int64_t>(lost.size())},
                                         {"n", count},
                                         {"query", Eigen::VectorXd(all.col(lost[0]))}}));
  }
  starts = Take(all, kept);
  points = Take(answered.points, kept);
  size = (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).norm();
  const std::optional<BoundingBox> box = oracle_.bounding_box();
  if (!box || walls_ > 0) return;
  const double slack = kBoxSlack * (box->upper - box->lower).norm();
  for (const auto& p : points.colwise()) {
    if ((p.array() < box->lower.array() - slack).any() ||
        (p.array() > box->upper.array() + slack).any()) {
      return add(MakeFinding("OUTSIDE_BOX", {{"answer", Eigen::VectorXd(p)}}));
    }
  }
}

void Probe::FindTangents() {
  const Eigen::Index stride = std::max<Eigen::Index>(1, points.cols() / kSome);
  Indices chosen;
  for (Eigen::Index j = 0; j < points.cols() && std::ssize(chosen) < kSome; j += stride) {
    chosen.push_back(j);
  }
  some = Take(points, chosen);
  moved_tangents = Differential(some, &ranks);
}

// At points of M the derivative of the closest point map is the projection on the tangent space:
// orthonormal bases of its image, and its rank.
std::vector<Basis> Probe::Differential(const Eigen::MatrixXd& at, std::vector<int>* its_ranks) {
  const int count = std::min(d_, std::max(kMaxDirections, 2 * k_ + 6));
  Eigen::MatrixXd directions = Eigen::MatrixXd::Identity(d_, d_);
  if (count < d_) directions = Orthonormal(RandomUnits(count));
  const double h = kDifferentialStep * size;
  Eigen::MatrixXd ends(d_, 2 * count * at.cols());
  for (Eigen::Index j = 0; j < at.cols(); ++j) {
    ends.middleCols(2 * count * j, count) = (h * directions).colwise() + at.col(j);
    ends.middleCols(2 * count * j + count, count) = (-h * directions).colwise() + at.col(j);
  }
  const Eigen::MatrixXd images = Closest(ends).points;
  std::vector<Basis> bases;
  for (Eigen::Index j = 0; j < at.cols(); ++j) {
    const Eigen::MatrixXd slope = (images.middleCols(2 * count * j, count) -
                                   images.middleCols(2 * count * j + count, count)) /
                                  (2 * h);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(slope, Eigen::ComputeThinU);
    const Eigen::VectorXd& s = svd.singularValues();
    bases.emplace_back(svd.matrixU().leftCols(k_));
    if (its_ranks == nullptr) continue;
    its_ranks->push_back(
        s[0] > kLeastSingular ? static_cast<int>((s.array() > kRankShare * s[0]).count()) : 0);
  }
  return bases;
}

std::vector<Basis> Probe::TangentsAt(const Eigen::MatrixXd& at) {
  return trusts_given ? GivenTangents(at) : Differential(at, nullptr);
}

Eigen::MatrixXd Probe::Normals(const std::vector<Basis>& bases) {
  Eigen::MatrixXd v = RandomUnits(static_cast<Eigen::Index>(bases.size()));
  for (Eigen::Index j = 0; j < v.cols(); ++j) {
    const Basis& t = bases[static_cast<size_t>(j)];
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
  const Eigen::Index n = points.cols();
  Indices order(static_cast<size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd distance = (points.colwise() - points.col(i)).colwise().squaredNorm();
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    const auto last = order.begin() + std::min<Eigen::Index>(count + 1, n);
    std::partial_sort(order.begin(), last, order.end(), [&](Eigen::Index a, Eigen::Index b) {
      return std::pair(distance[a], a) < std::pair(distance[b], b);
    });
    for (auto it = order.begin(); it != last; ++it) {
      if (*it != i) pairs.emplace_back(std::min(i, *it), std::max(i, *it));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

Pairs Probe::MostTurnedNeighbours() {
  Pairs pairs = Neighbours(kNeighbours);
  const std::vector<Basis> tangents = TangentsAt(points);
  std::vector<std::pair<double, size_t>> turned;
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto [a, b] = pairs[i];
    turned.emplace_back(-Turn(tangents[static_cast<size_t>(a)], tangents[static_cast<size_t>(b)]),
                        i);
  }
  std::sort(turned.begin(), turned.end());
  Pairs most;
  for (size_t i = 0; i < turned.size() && std::ssize(most) < kSome; ++i) {
    most.push_back(pairs[turned[i].second]);
  }
  return most;
}

int Probe::Pieces() {
  const Pairs pairs = Neighbours(kPieceNeighbours);
  Eigen::MatrixXd ways(d_, std::ssize(pairs) * (kPieceSteps - 1));
  Eigen::Index at = 0;
  for (const auto& [a, b] : pairs) {
    for (int i = 1; i < kPieceSteps; ++i) {
      ways.col(at++) = points.col(a) + (points.col(b) - points.col(a)) * i / kPieceSteps;
    }
  }
  const Answered way = Closest(ways);
  Indices label(static_cast<size_t>(points.cols()));
  std::iota(label.begin(), label.end(), Eigen::Index{0});
  const auto root = [&label](Eigen::Index i) {
    while (label[static_cast<size_t>(i)] != i) i = label[static_cast<size_t>(i)];
    return i;
  };
  at = 0;
  for (const auto& [a, b] : pairs) {
    const double leap = kLeap * (points.col(a) - points.col(b)).norm();
    Eigen::VectorXd last = points.col(a);
    bool walked = true;
    for (int i = 1; i < kPieceSteps; ++i, ++at) {
      walked = walked && way.found[at] && (way.points.col(at) - last).norm() <= leap;
      last = way.points.col(at);
    }
    walked = walked && (points.col(b) - last).norm() <= leap;
    if (walked) label[static_cast<size_t>(root(b))] = root(a);
  }
  int pieces = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) pieces += root(i) == i;
  return pieces;
}

double Turn(const Basis& a, const Basis& b) {
  const Eigen::MatrixXd rest = b - a * (a.transpose() * b);
  return std::asin(std::min(1.0, Eigen::JacobiSVD<Eigen::MatrixXd>(rest).singularValues()[0]));
}

double ReachFrom(const Eigen::VectorXd& v, const Basis& tangent, double shortest) {
  if (v.norm() <= shortest) return std::numeric_limits<double>::infinity();
  const double off = (v - tangent * (tangent.transpose() * v)).norm();
  return v.squaredNorm() / (2 * std::max(off, kLeastHeight * shortest));
}

}  // namespace stellate::doctor
