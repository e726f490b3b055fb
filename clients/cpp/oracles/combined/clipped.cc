#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "oracles/combined/common.h"
#include "oracles/combined/level_solver.h"
#include "oracles/equation_system.h"
#include "oracles/exactness.h"
#include "stellate/implicit.h"
#include "stellate/oracles/walls.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr size_t kMaxWalls = 64, kMaxWallsWithLabels = 16;

// All of R^d, as a manifold that is to be cut by walls.
class Space final : public Oracle {
 public:
  explicit Space(BoundingBox around) : around_(std::move(around)) {
    const Index d = around_.lower.size();
    if (d < 1 || around_.upper.size() != d ||
        !(around_.lower.array() < around_.upper.array()).all()) {
      Refuse("a solid needs a box around it, two corners of one space, the lower one first");
    }
  }

  int dimension() const override { return static_cast<int>(around_.lower.size()); }
  int ambient_dimension() const override { return dimension(); }
  Answer ClosestPoint(const MatrixXd& x) override { return {x, {}, {}, {}}; }
  bool has_tangent_basis() const override { return true; }
  MatrixXd TangentBasis(const MatrixXd& points) override {
    const MatrixXd identity = MatrixXd::Identity(dimension(), dimension());
    return identity.reshaped().replicate(1, points.cols());
  }
  std::optional<BoundingBox> bounding_box() const override { return around_; }
  std::shared_ptr<Oracle> DividedBy(const VectorXd& scale) const override {
    return std::make_shared<Space>(
        BoundingBox{around_.lower.cwiseQuotient(scale), around_.upper.cwiseQuotient(scale)});
  }

 private:
  BoundingBox around_;
};

void CheckFace(const Walls& face, int walls) {
  int last = -1;
  for (const int wall : face) {
    if (wall <= last || wall >= walls) {
      Refuse("a face has ascending numbers of walls, below " + std::to_string(walls));
    }
    last = wall;
  }
}

// Nearest points of M = {F = 0} where the level's functions are zero, too: equations of one system.
Answer OntoBoth(const EquationSystem& whole, const Level& level, int count, const MatrixXd& x) {
  const EquationSystem both = whole.With(level.f, level.slopes, count);
  Answer answer{x, std::vector<std::uint8_t>(static_cast<size_t>(x.cols()), 0), {}, {}};
  if (both.equations() > x.rows()) return answer;  // they leave nothing
  for (Index j = 0; j < x.cols(); ++j) {
    const VectorXd at = x.col(j);
    std::optional<VectorXd> nearest = NearestZero(both, at, at);
    if (!nearest) {  // on the way: once more, from M
      const std::optional<VectorXd> start = NearestZero(whole, at, at);
      if (start) nearest = NearestZero(both, at, *start);
    }
    if (!nearest) continue;
    answer.points.col(j) = *nearest;
    answer.found[static_cast<size_t>(j)] = 1;
  }
  return answer;
}

}  // namespace

Wall HalfSpace(const VectorXd& normal, double offset) {
  if (!normal.allFinite() || !(normal.norm() > 0)) Refuse("a half-space needs a normal");
  return {[normal, offset](const VectorXd& x) { return normal.dot(x) - offset; },
          [normal](const VectorXd& /*x*/) { return normal; }};
}

std::vector<Wall> Box(const VectorXd& lower, const VectorXd& upper) {
  const Index d = lower.size();
  if (d < 1 || upper.size() != d || !(lower.array() < upper.array()).all()) {
    Refuse("a box is two corners of one space, the lower one first");
  }
  std::vector<Wall> walls;
  for (const auto& [corner, sign] : {std::pair(&lower, 1.0), std::pair(&upper, -1.0)}) {
    for (Index i = 0; i < d; ++i) {
      if (std::isinf((*corner)[i])) continue;
      walls.push_back(HalfSpace(sign * VectorXd::Unit(d, i), sign * (*corner)[i]));
    }
  }
  return walls;
}

Wall Ball(const VectorXd& centre, double radius) {
  if (!centre.allFinite() || centre.size() < 1 || !(radius > 0)) {
    Refuse("a ball needs a centre and a positive radius");
  }
  return {
      [centre, radius](const VectorXd& x) { return radius * radius - (x - centre).squaredNorm(); },
      [centre](const VectorXd& x) -> VectorXd { return -2 * (x - centre); }};
}

Clipped::Clipped(std::shared_ptr<Oracle> oracle, std::vector<Wall> walls, MatrixXd seeds,
                 std::vector<std::uint8_t> labels, std::vector<Walls> closures)
    : base_(std::move(oracle)),
      walls_(std::move(walls)),
      seeds_(std::move(seeds)),
      labels_(std::move(labels)),
      closures_(std::move(closures)) {
  if (base_ == nullptr) Refuse("there is no oracle to clip");
  if (const auto* const clipped = dynamic_cast<const Clipped*>(base_.get())) {
    if (!clipped->labels_.empty()) {
      Refuse("what has labels cannot be clipped: give all walls to one Clipped");
    }
    walls_.insert(walls_.begin(), clipped->walls_.begin(), clipped->walls_.end());
    if (seeds_.size() == 0) seeds_ = clipped->seeds_;
    base_ = std::shared_ptr<Oracle>(clipped->base_);
  }
  RefuseWalls(*base_, "Clipped");
  if (!base_->has_tangent_basis()) Refuse("to clip a manifold takes its tangent bases");
  if (walls_.empty() || walls_.size() > kMaxWalls) {
    Refuse("there are " + std::to_string(walls_.size()) + " walls; there have to be 1 to 64");
  }
  for (const Wall& wall : walls_) {
    if (!wall.g) Refuse("walls have to be functions");
  }
  if (!labels_.empty() &&
      (walls_.size() > kMaxWallsWithLabels || labels_.size() != std::size_t{1} << walls_.size())) {
    Refuse("there are " + std::to_string(labels_.size()) +
           " labels; there has to be one for each of "
           "the vectors of signs of at most 16 walls");
  }
  for (const Walls& closure : closures_) {
    for (const int wall : closure) {
      if (wall < 0 || wall >= std::ssize(walls_)) {
        Refuse("closures are sets of walls, and there is no wall " + std::to_string(wall));
      }
    }
  }
  if (seeds_.size() == 0) seeds_ = base_->seeds();
  if (seeds_.size() > 0 && seeds_.rows() != ambient_dimension()) {
    Refuse("seeds have to be points of R^" + std::to_string(ambient_dimension()));
  }
  scale_ = ScaleOf(*base_);
  const BoundingBox where = WhereOf(*base_);
  for (size_t i = 0; i < walls_.size(); ++i) {
    exactness_.push_back(
        std::make_shared<const Exactness>("wall " + std::to_string(i), where, base_->seeds()));
  }
}

void Clipped::InsistOnExactness(int wall) const {
  const auto number = static_cast<size_t>(wall);
  exactness_[number]->Insist(
      [&g = walls_[number].g](const VectorXd& x) { return VectorXd::Constant(1, g(x)); });
}

bool Clipped::has_intersect_flat() const {
  return base_->has_intersect_flat() && dimension() < ambient_dimension();
}

// Walls of a face from which all others of it follow.
Walls Clipped::Independent(const Walls& face) const {
  Walls chosen;
  std::set<int> zero;
  const auto follows = [&] {
    for (const Walls& closure : closures_) {
      std::set<int> rest;
      for (const int wall : closure) {
        if (!zero.contains(wall)) rest.insert(wall);
      }
      if (rest.size() == 1) return zero.insert(*rest.begin()).second;
    }
    return false;
  };
  for (const int wall : face) {
    if (!zero.insert(wall).second) continue;
    chosen.push_back(wall);
    while (follows()) {
    }
  }
  return chosen;
}

VectorXd Clipped::Slope(int wall, const VectorXd& x) const {
  const Wall& it = walls_[static_cast<size_t>(wall)];
  if (it.gradient) return it.gradient(x);
  const auto f = [&it](const VectorXd& at) { return VectorXd::Constant(1, it.g(at)); };
  return Differences(f, x, scale_).row(0).transpose();
}

Answer Clipped::FacePoint(const MatrixXd& x, const Walls& asked) {
  CheckFace(asked, walls());
  for (const int wall : asked) InsistOnExactness(wall);
  const Walls face = Independent(asked);
  const auto count = static_cast<Index>(face.size());
  const Level level{[&](const VectorXd& y) {
                      VectorXd values(count);
                      for (Index i = 0; i < count; ++i) {
                        const int wall = face[static_cast<size_t>(i)];
                        values[i] = walls_[static_cast<size_t>(wall)].g(y);
                      }
                      return values;
                    },
                    [&](const VectorXd& y) {
                      MatrixXd slopes(count, y.size());
                      for (Index i = 0; i < count; ++i) {
                        slopes.row(i) = Slope(face[static_cast<size_t>(i)], y).transpose();
                      }
                      return slopes;
                    },
                    scale_};
  const auto* const equations = dynamic_cast<const ImplicitOracle*>(base_.get());
  return equations != nullptr ? OntoBoth(equations->system(), level, static_cast<int>(count), x)
                              : OntoLevel(*base_, level, x);
}

MatrixXd Clipped::Clearances(const MatrixXd& points) {
  for (int wall = 0; wall < walls(); ++wall) InsistOnExactness(wall);
  MatrixXd clearances(walls(), points.cols());
  VectorXd x;
  for (Index j = 0; j < points.cols(); ++j) {
    x = points.col(j);
    for (Index i = 0; i < clearances.rows(); ++i) {
      clearances(i, j) = walls_[static_cast<size_t>(i)].g(x);
    }
  }
  return clearances;
}

MatrixXd Clipped::Conormals(const MatrixXd& points, const Walls& face) {
  CheckFace(face, walls());
  const Index d = points.rows();
  const MatrixXd bases = base_->TangentBasis(points);
  MatrixXd outward(d * static_cast<Index>(face.size()), points.cols());
  VectorXd x;
  for (Index j = 0; j < points.cols(); ++j) {
    x = points.col(j);
    const Eigen::Map<const RowMajor> basis(bases.col(j).data(), d, dimension());
    for (size_t i = 0; i < face.size(); ++i) {
      const VectorXd along = basis.transpose() * Slope(face[i], x);
      const double steep = along.norm();
      outward.col(j).segment(static_cast<Index>(i) * d, d) =
          basis * (-along / (steep > 0 ? steep : 1.0));
    }
  }
  return outward;
}

std::shared_ptr<Oracle> Clipped::DividedBy(const VectorXd& scale) const {
  std::shared_ptr<Oracle> base = base_->DividedBy(scale);
  if (base == nullptr) return base;
  std::vector<Wall> walls;
  for (const Wall& wall : walls_) {
    Wall& divided = walls.emplace_back();
    divided.g = [g = wall.g, scale](const VectorXd& y) { return g(y.cwiseProduct(scale)); };
    if (!wall.gradient) continue;
    divided.gradient = [own = wall.gradient, scale](const VectorXd& y) -> VectorXd {
      return own(y.cwiseProduct(scale)).cwiseProduct(scale);
    };
  }
  MatrixXd seeds = seeds_;
  if (seeds.size() > 0) seeds.array().colwise() /= scale.array();
  return std::make_shared<Clipped>(std::move(base), std::move(walls), std::move(seeds), labels_,
                                   closures_);
}

Solid::Solid(std::vector<Wall> walls, BoundingBox around, MatrixXd seeds,
             std::vector<std::uint8_t> labels, std::vector<Walls> closures)
    : Clipped(std::make_shared<Space>(std::move(around)), std::move(walls), std::move(seeds),
              std::move(labels), std::move(closures)) {}

}  // namespace stellate::oracles
