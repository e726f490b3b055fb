#pragma once

#include <Eigen/Dense>
#include <bit>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/closures.h"
#include "core/mesher.h"
#include "tests/core/support/plain_equations.h"

namespace stellate::testing {

// M = { x : F(x) = 0, g_i(x) >= 0 }: closest points on any face by Newton's method on F and the
// face's walls together.
class Domain {
 public:
  // A function of R^d: its value, and its gradient into the second argument.
  using Function = std::function<double(const Eigen::VectorXd&, Eigen::VectorXd*)>;

  int k = 0, d = 0;
  std::vector<Function> equations;  // d - k
  std::vector<Function> walls;
  core::Closures closures;  // of walls that depend on each other
  BoundingBox box;
  std::vector<int> homology;  // ranks over Z/2, by dimension
  std::vector<int> boundary_homology;

  // The same, turned and moved a little at random; 0: as it is.
  Domain Turned(unsigned seed) const {
    if (seed == 0) return *this;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    const auto number = [&](double) { return normal(random); };
    const Eigen::MatrixXd turn =
        Eigen::HouseholderQR<Eigen::MatrixXd>(Eigen::MatrixXd::Zero(d, d).unaryExpr(number))
            .householderQ();
    const Eigen::VectorXd move = 0.1 * Eigen::VectorXd::Zero(d).unaryExpr(number);
    const auto turned = [turn, move](const Function& f) -> Function {
      return [f, turn, move](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
        const double value = f(turn.transpose() * (x - move), gradient);
        if (gradient) *gradient = (turn * *gradient).eval();
        return value;
      };
    };
    Domain m = *this;
    for (Function& f : m.equations) f = turned(f);
    for (Function& f : m.walls) f = turned(f);
    // A box around the turned one's ball.
    const double half = (box.upper - box.lower).norm() / 2;
    m.box = {move.array() - half, move.array() + half};
    return m;
  }

  core::Specification SpecificationFor(double epsilon) const {
    core::Specification spec;
    spec.dimension = k;
    spec.ambient_dimension = d;
    spec.epsilon = epsilon;
    spec.walls = static_cast<int>(walls.size());
    spec.closures = closures.sets();
    spec.oracle.tangent_basis = true;
    spec.oracle.conormals = !walls.empty();
    spec.bounding_box = core::BoundingBox{box.lower, box.upper};
    return spec;
  }

  core::Answers AnswersOf(const core::QueryBatch& batch) {
    core::Answers answers;
    for (const core::QueryBlock& block : batch.blocks) answers.blocks.push_back(AnswerOf(block));
    return answers;
  }

  core::AnswerBlock AnswerOf(const core::QueryBlock& block) {
    const std::vector<int> face = WallsOf(block.face);
    core::AnswerBlock answer;
    const Eigen::Index n = block.size();
    answer.points = block.points;
    answer.found.assign(static_cast<std::size_t>(n), 1);
    if (static_cast<int>(face.size()) + d - k > 0) {
      Answer there = block.kind == core::QueryKind::kClosestPoint
                         ? Solver(Independent(block.face)).ClosestPoint(block.points)
                         : Solver(0).IntersectFlat(block.points, block.bases, block.radii);
      answer.points = there.points;
      if (!there.found.empty()) answer.found = there.found;
    }
    if (block.want.tangents) answer.tangents.setZero(d * k, n);
    if (block.want.clearances) {
      answer.clearances.setZero(static_cast<Eigen::Index>(walls.size()), n);
      answer.conormals.setZero(static_cast<Eigen::Index>(face.size()) * d, n);
    }
    for (Eigen::Index j = 0; j < n; ++j) {
      if (!answer.found[static_cast<std::size_t>(j)]) continue;
      const Eigen::VectorXd y = answer.points.col(j);
      const Eigen::MatrixXd tangents = Tangents(y);
      if (block.want.tangents)
        for (int i = 0; i < d; ++i)
          for (int a = 0; a < k; ++a) answer.tangents(i * k + a, j) = tangents(i, a);
      if (!block.want.clearances) continue;
      for (std::size_t w = 0; w < walls.size(); ++w)
        answer.clearances(static_cast<Eigen::Index>(w), j) = walls[w](y, nullptr);
      for (std::size_t w = 0; w < face.size(); ++w) {
        Eigen::VectorXd gradient(d);
        walls[static_cast<std::size_t>(face[w])](y, &gradient);
        answer.conormals.col(j).segment(static_cast<Eigen::Index>(w) * d, d) =
            -(tangents * (tangents.transpose() * gradient)).normalized();
      }
    }
    return answer;
  }

  Eigen::MatrixXd Tangents(const Eigen::VectorXd& y) const {
    if (equations.empty()) return Eigen::MatrixXd::Identity(d, d);
    Eigen::MatrixXd jacobian(d, d - k);
    Eigen::VectorXd gradient(d);
    for (std::size_t e = 0; e < equations.size(); ++e) {
      equations[e](y, &gradient);
      jacobian.col(static_cast<Eigen::Index>(e)) = gradient;
    }
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(jacobian);
    return (qr.householderQ() * Eigen::MatrixXd::Identity(d, d)).rightCols(k);
  }

 private:
  // Walls of a face on which all others of it are zero, too.
  core::WallSet Independent(core::WallSet face) const {
    core::WallSet chosen = 0;
    core::ForEachWall(face, [&](int wall) {
      if (!core::IsSubset(core::SetOfWall(wall), closures.Close(chosen)))
        chosen |= core::SetOfWall(wall);
    });
    return chosen;
  }
  static std::vector<int> WallsOf(core::WallSet set) {
    std::vector<int> walls;
    core::ForEachWall(set, [&](int wall) { walls.push_back(wall); });
    return walls;
  }

  // Of the face without tangent directions, of dimension 0, a stand-in of its own.
  class Corner final : public Oracle {
   public:
    Corner(int d, std::vector<Function> all) : d_(d), all_(std::move(all)) {}
    int dimension() const override { return 0; }
    int ambient_dimension() const override { return d_; }
    Answer ClosestPoint(const Eigen::MatrixXd& x) override {
      Answer answer;
      answer.points = x;
      answer.found.assign(static_cast<std::size_t>(x.cols()), 0);
      for (Eigen::Index j = 0; j < x.cols(); ++j) {
        Eigen::VectorXd y = x.col(j), value(d_), gradient(d_);
        Eigen::MatrixXd jacobian(d_, d_);
        for (int step = 0; step < 60; ++step) {
          for (int i = 0; i < d_; ++i) {
            value[i] = all_[static_cast<std::size_t>(i)](y, &gradient);
            jacobian.row(i) = gradient;
          }
          const Eigen::VectorXd move = jacobian.fullPivLu().solve(value);
          y -= std::min(1.0, 0.3 / std::max(move.norm(), 1e-300)) * move;
          if (move.norm() < 1e-14) {  // parallel planes have no point in common
            answer.found[static_cast<std::size_t>(j)] = value.norm() < 1e-9;
            break;
          }
        }
        answer.points.col(j) = y;
      }
      return answer;
    }

   private:
    int d_;
    std::vector<Function> all_;
  };

  Oracle& Solver(core::WallSet face) {
    std::shared_ptr<Oracle>& solver = solvers_[face];
    if (solver) return *solver;
    std::vector<Function> all = equations;
    for (const int wall : WallsOf(face)) all.push_back(walls[static_cast<std::size_t>(wall)]);
    const int count = static_cast<int>(all.size());
    if (count == d) return *(solver = std::make_shared<Corner>(d, all));
    const auto value = [all](const Eigen::VectorXd& x) {
      Eigen::VectorXd f(static_cast<Eigen::Index>(all.size()));
      for (std::size_t i = 0; i < all.size(); ++i)
        f[static_cast<Eigen::Index>(i)] = all[i](x, nullptr);
      return f;
    };
    const auto jacobian = [all](const Eigen::VectorXd& x) {
      Eigen::MatrixXd j(static_cast<Eigen::Index>(all.size()), x.size());
      Eigen::VectorXd gradient(x.size());
      for (std::size_t i = 0; i < all.size(); ++i) {
        all[i](x, &gradient);
        j.row(static_cast<Eigen::Index>(i)) = gradient;
      }
      return j;
    };
    return *(solver = std::make_shared<PlainEquations>(d - count, d, value, jacobian, box));
  }

  std::map<core::WallSet, std::shared_ptr<Oracle>> solvers_;
};

inline BoundingBox CubeOf(int d, double half) {
  return {Eigen::VectorXd::Constant(d, -half), Eigen::VectorXd::Constant(d, half)};
}

// offset + normal . x
inline Domain::Function HalfSpaceOf(Eigen::VectorXd normal, double offset) {
  return [normal, offset](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    if (gradient) *gradient = normal;
    return offset + normal.dot(x);
  };
}

// sign (|x - centre|^2 - radius^2), over the first `count` coordinates.
inline Domain::Function BallOf(Eigen::VectorXd centre, double radius, double sign, int count) {
  return [=](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    const Eigen::VectorXd off = (x - centre).head(count);
    if (gradient) {
      gradient->setZero(x.size());
      gradient->head(count) = 2 * sign * off;
    }
    return sign * (off.squaredNorm() - radius * radius);
  };
}

// The torus of revolution 1 : 0.4, as (|x|^2 + 1 - 0.16)^2 - 4 (x^2 + y^2).
inline Domain::Function TorusOf(double sign = 1) {
  return [sign](const Eigen::VectorXd& x, Eigen::VectorXd* gradient) {
    const double a = x.squaredNorm() + 1 - 0.16;
    if (gradient) {
      *gradient = sign * 4 * a * x;
      gradient->head(2) -= sign * 8 * x.head(2);
    }
    return sign * (a * a - 4 * x.head(2).squaredNorm());
  };
}

}  // namespace stellate::testing
