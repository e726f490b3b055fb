#include "core/batch.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/base/dense.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/label_table.h"
#include "core/list_walls.h"
#include "core/wall_beyond.h"

namespace stellate::core {
namespace {

using Eigen::Index;

const char* KindName(QueryKind kind) {
  return kind == QueryKind::kClosestPoint ? "closest_point" : "intersect_flat";
}

// "closest_point query 17", the start of each message.
std::string Where(const QueryBlock& block, Index query) {
  return Message(KindName(block.kind), " query ", query);
}

// The additional arrays of answers for a manifold with boundary.
Status CheckFaceShape(const Specification& spec, const QueryBlock& block, const AnswerBlock& answer,
                      bool any_found) {
  if (!block.want.clearances || !any_found) return Status::Ok();
  const Index n = answer.points.cols();
  if (answer.clearances.rows() != spec.walls || answer.clearances.cols() != n) {
    return {StatusCode::kOracleShape,
            Message(KindName(block.kind), " answers: clearances hold ", answer.clearances.size(),
                    " numbers but ", n, " points and ", spec.walls, " walls need ", n * spec.walls,
                    ": send one for each wall at each point")};
  }
  const Index rows = CountWalls(block.face) * spec.ambient_dimension;
  if (rows > 0 && (answer.conormals.rows() != rows || answer.conormals.cols() != n)) {
    return {StatusCode::kOracleShape,
            Message(KindName(block.kind), " answers: conormals hold ", answer.conormals.size(),
                    " numbers but ", n, " points on ", CountWalls(block.face), " walls in R^",
                    spec.ambient_dimension, " need ", n * rows,
                    ": send a vector for each wall of the face at each point")};
  }
  return Status::Ok();
}

Status CheckShape(const Specification& spec, const QueryBlock& block, Index first,
                  const AnswerBlock& answer) {
  const Index d = spec.ambient_dimension;
  const Index n = answer.points.cols();
  const auto refuse = [&](const auto&... parts) {
    return Status{StatusCode::kOracleShape, Message(KindName(block.kind), " answers: ", parts...)};
  };
  if (answer.points.rows() != d && n > 0) {
    return refuse("points have ", answer.points.rows(), " coordinates but the ambient dimension ",
                  "is ", d, ": send n x d numbers");
  }
  if (first < 0 || n > block.size() - first) {
    return refuse(n, " points from query ", first, " on but the block holds ", block.size(),
                  " queries: send one point for each query");
  }
  if (!answer.found.empty() && static_cast<Index>(answer.found.size()) != n) {
    return refuse("found has ", answer.found.size(), " flags for ", n,
                  " points: send one for each, or none when all were found");
  }
  const bool any_found =
      n > 0 && (answer.found.empty() ||
                std::any_of(answer.found.begin(), answer.found.end(), [](auto f) { return f; }));
  if (answer.sizes.size() == 0 && block.want.sizes && any_found) {
    return refuse(
        "no sizes came but the query wants them: send one length for each point, or declare that "
        "the oracle has no local_size");
  }
  if (answer.sizes.size() != 0 && answer.sizes.size() != n) {
    return refuse("sizes hold ", answer.sizes.size(), " numbers for ", n,
                  " points: send one length for each");
  }
  if (Status s = CheckFaceShape(spec, block, answer, any_found); !s.ok()) return s;
  const Index basis_size = d * spec.dimension;
  if (answer.tangents.size() == 0) {
    if (block.want.tangents && any_found) {
      return refuse(
          "no tangent bases came but the query wants them: send n x d x k numbers, or "
          "declare that the oracle has no tangent_basis");
    }
    return Status::Ok();
  }
  if (answer.tangents.rows() != basis_size || answer.tangents.cols() != n) {
    return refuse("tangents hold ", answer.tangents.size(), " numbers but ", n,
                  " bases of d x k = ", d, " x ", spec.dimension, " need ", n * basis_size,
                  ": send n x d x k numbers");
  }
  return Status::Ok();
}

// The largest value whose square is finite.
bool IsUsable(double value) { return std::abs(value) <= kMaxLength; }

Status CheckFinite(const QueryBlock& block, Index query, const char* what, const double* values,
                   Index count) {
  bool all = true;
  for (Index i = 0; i < count; ++i) all = all && IsUsable(values[i]);
  if (all) return Status::Ok();
  for (Index i = 0; i < count; ++i) {
    if (!IsUsable(values[i])) {
      return {StatusCode::kOracleNotFinite,
              Message(Where(block, query), ": the answer's ", what, " is ", values[i],
                      " in coordinate ", i, " but must be finite and at most ", kMaxLength,
                      " in size: answer \"not found\" when there is no point")};
    }
  }
  return Status::Ok();
}

Status CheckIntersection(const Specification& spec, const QueryBlock& block, Index query,
                         const Eigen::Ref<const Eigen::VectorXd>& y) {
  const Index k = spec.dimension;
  const Index d = spec.ambient_dimension;
  const auto c = block.points.col(query);
  const auto offset = y - c;
  const double distance = offset.norm();
  const double rounding =
      kRoundingTolerance * std::max(y.lpNorm<Eigen::Infinity>(), c.lpNorm<Eigen::Infinity>());
  // An unbounded search has no scale but its own result.
  const double radius = block.radii[query];
  const double scale = std::isfinite(radius) ? radius : distance;

  const double* basis = block.bases.col(query).data();
  double off_flat_squared = 0;
  for (Index a = 0; a < k; ++a) {
    double component = 0;
    for (Index i = 0; i < d; ++i) component += basis[i * k + a] * offset[i];
    off_flat_squared += component * component;
  }
  const double off_flat = std::sqrt(off_flat_squared);
  const double off_flat_bound = kFlatTolerance * scale + rounding;
  if (off_flat > off_flat_bound) {
    return {StatusCode::kOracleOffFlat,
            Message(Where(block, query), ": the answer lies ", off_flat,
                    " off the flat c + T^perp, more than the ", off_flat_bound,
                    " allowed for a search radius of ", radius,
                    ": solve to a tighter tolerance, or answer \"not found\"")};
  }
  const double radius_bound = radius * (1 + kRadiusTolerance) + rounding;
  if (distance > radius_bound) {
    return {StatusCode::kOracleOutsideRadius,
            Message(Where(block, query), ": the answer lies ", distance, " from c, beyond the ",
                    "search radius ", radius, ": answer \"not found\" when the nearest ",
                    "intersection is farther")};
  }
  return Status::Ok();
}

Status CheckTangent(const Specification& spec, const QueryBlock& block, Index query,
                    const double* basis) {
  const Index k = spec.dimension;
  const Index d = spec.ambient_dimension;
  for (Index a = 0; a < k; ++a) {
    for (Index b = a; b < k; ++b) {
      double dot = 0;
      for (Index i = 0; i < d; ++i) dot += basis[i * k + a] * basis[i * k + b];
      const double error = std::abs(dot - (a == b ? 1 : 0));
      if (!(error <= kOrthonormalTolerance)) {
        return {StatusCode::kOracleBadTangent,
                Message(Where(block, query), ": the tangent basis is not orthonormal: vectors ", a,
                        " and ", b, " have the inner product ", dot, ", off by ", error, " where ",
                        kOrthonormalTolerance,
                        " is allowed: orthonormalise it, columns being tangent vectors")};
      }
    }
  }
  return Status::Ok();
}

// As kLeastTransversality, 3 degrees, where the angle inside M is nearly straight: there is no thin
// wedge of M, and none beyond it. With labels any of the four wedges may be one.
constexpr double kLeastBlunt = 0.0013;
// Cosine of conormals of which that is asked.
constexpr double kBlunt = 0.9;

// Whether walls cross at an angle, but for two of them or more that are nearly one inside of M: all
// others cross the edge between these. `along`: conormals in tangent coordinates.
bool CrossBluntly(Eigen::MatrixXd along) {
  for (Index j = 1; j < along.cols(); ++j)
    for (Index i = 0; i < j; ++i) {
      const double cosine = along.col(i).dot(along.col(j));
      if (cosine <= kBlunt) continue;
      if (1 - cosine < kLeastBlunt) return false;
      along.col(j) = (along.col(j) - cosine * along.col(i)).normalized();
    }
  return EigenvaluesOfSymmetric(along.transpose() * along)[0] >= kLeastTransversality;
}

// Describes walls that meet nearly tangentially: the two that do most, and their angle inside M.
// `along`: conormals in tangent coordinates, by ascending wall.
std::string NameTangential(WallSet walls, const Eigen::MatrixXd& along) {
  double most = 0;
  int pair[2] = {0, 0};
  int a = 0;
  ForEachWall(walls, [&](int first) {
    int b = 0;
    ForEachWall(walls, [&](int second) {
      const double cosine = -along.col(a).dot(along.col(b));
      if (b > a && std::abs(cosine) > std::abs(most)) {
        most = cosine;
        pair[0] = first;
        pair[1] = second;
      }
      ++b;
    });
    ++a;
  });
  const double degrees = std::acos(std::clamp(most, -1.0, 1.0)) * 180 / std::numbers::pi;
  return Message("walls ", pair[0], " and ", pair[1], " at ", Brief(degrees), " degrees");
}

// Whether a point of a face is in M, and of arrangements the face is live there: elsewhere walls
// may meet as they like.
bool IsOnM(const Specification& spec, WallSet face, const double* clearances) {
  if (spec.labels.empty()) return !WallBeyond(clearances, spec.walls, face);
  return LabelTable(spec.labels, Closures(spec.closures))
             .Piece(face, SignsOf(clearances, spec.walls)) != 0;
}

// Checks that conormals are unit, tangent to the tangent basis of the same answer, and independent
// of each other. Where walls meet beyond others they need not be: M is not there.
Status CheckConormals(const Specification& spec, const QueryBlock& block, Index query,
                      const AnswerBlock& answer, Index j) {
  const double* const basis = answer.tangents.col(j).data();
  const double* const conormals = answer.conormals.col(j).data();
  const Index k = spec.dimension, d = spec.ambient_dimension;
  const int count = CountWalls(block.face);
  const auto refuse = [&](const auto&... parts) {
    return Status{StatusCode::kOracleBadConormal, Message(Where(block, query), ": ", parts...)};
  };
  Eigen::MatrixXd along(k, count);
  int n = 0;
  Status status = Status::Ok();
  ForEachWall(block.face, [&](int wall) {
    const Eigen::Map<const Eigen::VectorXd> conormal(conormals + n * d, d);
    for (Index a = 0; a < k; ++a) {
      along(a, n) = 0;
      for (Index i = 0; i < d; ++i) along(a, n) += basis[i * k + a] * conormal[i];
    }
    const double length = conormal.norm(), tangent = along.col(n).norm();
    if (status.ok() && !(std::abs(length - 1) <= kConormalTolerance))
      status = refuse("the conormal of wall ", wall, " has the length ", length,
                      " but must be a unit vector");
    if (status.ok() && !(tangent >= 1 - kConormalTolerance))
      status = refuse("the conormal of wall ", wall,
                      " is not tangent to the manifold: of its "
                      "length ",
                      tangent,
                      " lies in the tangent space; take the wall's outward "
                      "normal and project it onto that, or is the wall tangential here?");
    ++n;
  });
  if (!status.ok() || count < 2 || !IsOnM(spec, block.face, answer.clearances.col(j).data()))
    return status;
  // Of walls that depend on each other, only as many are independent as the face takes.
  const Eigen::MatrixXd gram = along.transpose() * along;
  const int dependent = count - Closures(spec.closures).Codimension(block.face);
  const Eigen::VectorXd eigenvalues = EigenvaluesOfSymmetric(gram);
  if (dependent > 0 && eigenvalues[dependent - 1] >= kLeastTransversality)
    return refuse("the closures say that walls ", ListWalls(block.face),
                  " vanish together, but at ", NamePoint(answer.points.col(j)),
                  ", on all of them, their conormals are independent");
  const double independent = eigenvalues[dependent];
  if (independent >= kLeastTransversality || (spec.labels.empty() && CrossBluntly(along)))
    return Status::Ok();
  return refuse("the walls meet nearly tangentially: ", NameTangential(block.face, along), ", at ",
                NamePoint(answer.points.col(j)),
                "; the smallest eigenvalue of their conormals' Gram matrix is ", independent,
                ", less than ", kLeastTransversality, "; walls must cross at an angle");
}

Status CheckSize(const QueryBlock& block, Index query, double size) {
  const auto refuse = [&](StatusCode code) -> Status {
    return {code, Message(Where(block, query), ": the size at the answer is ", size,
                          " but must be a length between ", kMinLength, " and ", kMaxLength,
                          ": give a large one where epsilon alone is to decide")};
  };
  if (!IsUsable(size)) return refuse(StatusCode::kOracleNotFinite);
  return size >= kMinLength ? Status::Ok() : refuse(StatusCode::kOracleBadSize);
}

// Checks answer j, to the query of that number.
Status CheckAnswer(const Specification& spec, const QueryBlock& block, Index query,
                   const AnswerBlock& answer, Index j) {
  const double* const point = answer.points.col(j).data();
  if (Status s = CheckFinite(block, query, "point", point, answer.points.rows()); !s.ok()) return s;
  if (block.kind == QueryKind::kIntersectFlat)
    if (Status s = CheckIntersection(spec, block, query, answer.points.col(j)); !s.ok()) return s;
  if (answer.tangents.size() > 0) {
    const double* const basis = answer.tangents.col(j).data();
    if (Status s = CheckFinite(block, query, "tangent basis", basis, answer.tangents.rows());
        !s.ok())
      return s;
    if (Status s = CheckTangent(spec, block, query, basis); !s.ok()) return s;
  }
  if (block.want.clearances) {
    const double* const clearances = answer.clearances.col(j).data();
    if (Status s = CheckFinite(block, query, "clearance", clearances, spec.walls); !s.ok())
      return s;
  }
  if (block.want.clearances && block.face != 0) {
    const double* const conormals = answer.conormals.col(j).data();
    if (Status s = CheckFinite(block, query, "conormal", conormals, answer.conormals.rows());
        !s.ok())
      return s;
    if (Status s = CheckConormals(spec, block, query, answer, j); !s.ok()) return s;
  }
  return answer.sizes.size() > 0 ? CheckSize(block, query, answer.sizes[j]) : Status::Ok();
}

}  // namespace

QueryBlock QueryBlock::Rows(Index first, Index count) const {
  QueryBlock some;
  some.kind = kind;
  some.want = want;
  some.face = face;
  ForEachField([&](auto field) { some.*field = columns::Some(this->*field, first, count); });
  return some;
}

AnswerBlock AnswerBlock::Shape(int dimension, int walls, const QueryBlock& block, Index count) {
  const Index d = block.points.rows();
  AnswerBlock shape;
  shape.points.setZero(d, count);
  shape.found.assign(static_cast<std::size_t>(count), 1);
  if (block.want.tangents) shape.tangents.setZero(d * dimension, count);
  if (block.want.sizes) shape.sizes.setZero(count);
  if (block.want.clearances) {
    shape.clearances.setZero(walls, count);
    if (block.face != 0) shape.conormals.setZero(CountWalls(block.face) * d, count);
  }
  return shape;
}

AnswerBlock AnswerBlock::Rows(Index first, Index count) const {
  AnswerBlock some;
  ForEachField([&](auto field) { some.*field = columns::Some(this->*field, first, count); });
  return some;
}

void AnswerBlock::Put(Index first, const AnswerBlock& some) {
  ForEachField([&](auto field) {
    const auto& from = some.*field;
    auto& to = this->*field;
    const bool fits = columns::Count(to) > 0 && columns::Count(from) == some.size() &&
                      columns::Rows(from) == columns::Rows(to);
    if (fits) columns::Put(from, first, &to);
  });
}

bool AnswerBlock::Fits(const AnswerBlock& shape) const {
  bool fits = true;
  ForEachField([&](auto field) {
    const auto& own = this->*field;
    fits = fits &&
           (columns::Count(own) == 0 ||
            (columns::Count(own) == size() && columns::Rows(own) == columns::Rows(shape.*field)));
  });
  return fits;
}

Status CheckAnswerShape(const Specification& spec, const QueryBlock& block, Eigen::Index first,
                        const AnswerBlock& answer) {
  return CheckShape(spec, block, first, answer);
}

Status CheckAnswers(const Specification& spec, const QueryBlock& block, Eigen::Index first,
                    const AnswerBlock& answer) {
  if (Status s = CheckShape(spec, block, first, answer); !s.ok()) return s;
  for (Index j = 0; j < answer.points.cols(); ++j) {
    if (!answer.found.empty() && answer.found[j] == 0) continue;
    if (Status s = CheckAnswer(spec, block, first + j, answer, j); !s.ok()) return s;
  }
  return Status::Ok();
}

}  // namespace stellate::core
