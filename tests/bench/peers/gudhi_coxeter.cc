// GUDHI prints to std::cerr without including it.
// clang-format off
#include <iostream>
#include <gudhi/Coxeter_triangulation.h>
#include <gudhi/Implicit_manifold_intersection_oracle.h>
#include <gudhi/Manifold_tracing.h>
#include <gudhi/Coxeter_triangulation/Cell_complex/Cell_complex.h>
// clang-format on

#include <Eigen/QR>
#include <algorithm>
#include <memory>
#include <random>
#include <stdexcept>
#include <unordered_map>

#include "tests/bench/peers/peer.h"
#include "tests/bench/peers/quality.h"
#include "tests/support/make_manifold.h"

namespace stellate::bench {
namespace {

namespace coxeter = Gudhi::coxeter_triangulation;
using Triangulation = coxeter::Coxeter_triangulation<>;
using Tracing = coxeter::Manifold_tracing<Triangulation>;
using CellComplex = coxeter::Cell_complex<Tracing::Out_simplex_map>;
using Cell = CellComplex::Hasse_cell;

constexpr int kSeeds = 20;

// A sphere of radius 1 in the first coordinates, or a product of unit circles, one in every two;
// the remaining coordinates are zero. A model of GUDHI's FunctionForImplicitManifold.
class Function {
 public:
  Function(const Manifold& manifold, int ambient_dimension, std::uint64_t* evaluations)
      : inner_(manifold.ambient_dimension()),
        codimension_(ambient_dimension - manifold.dimension()),
        block_(manifold.facts().spec.rfind("flat-torus", 0) == 0 ? 2 : inner_),
        ambient_dimension_(ambient_dimension),
        evaluations_(evaluations) {
    if (block_ != 2 && manifold.facts().spec.rfind("sphere", 0) != 0) {
      throw std::runtime_error("no implicit function for " + manifold.facts().spec);
    }
  }

  Eigen::VectorXd operator()(const Eigen::VectorXd& x) const {
    ++*evaluations_;
    Eigen::VectorXd value(codimension_);
    Eigen::Index row = 0;
    for (int i = 0; i < inner_; i += block_) value[row++] = x.segment(i, block_).squaredNorm() - 1;
    value.tail(codimension_ - row) = x.tail(ambient_dimension_ - inner_);
    return value;
  }
  std::size_t amb_d() const { return static_cast<std::size_t>(ambient_dimension_); }
  std::size_t cod_d() const { return static_cast<std::size_t>(codimension_); }

 private:
  int inner_, codimension_, block_, ambient_dimension_;
  std::uint64_t* evaluations_;
};

// Negative beyond the offset along a unit vector of the first coordinates. A model of GUDHI's
// FunctionForImplicitManifold.
class Beyond {
 public:
  Beyond(Eigen::VectorXd pole, double offset, int ambient_dimension, std::uint64_t* evaluations)
      : pole_(std::move(pole)),
        offset_(offset),
        ambient_dimension_(ambient_dimension),
        evaluations_(evaluations) {}

  Eigen::VectorXd operator()(const Eigen::VectorXd& x) const {
    ++*evaluations_;
    return Eigen::VectorXd::Constant(1, offset_ - pole_.dot(x.head(pole_.size())));
  }
  std::size_t amb_d() const { return static_cast<std::size_t>(ambient_dimension_); }
  std::size_t cod_d() const { return 1; }

 private:
  Eigen::VectorXd pole_;
  double offset_;
  int ambient_dimension_;
  std::uint64_t* evaluations_;
};

// Cuts the convex cells into simplices without new vertices: each cell is coned from its lowest
// vertex over those of its facets that do not hold it, so that cells agree on what they share.
class Pulling {
 public:
  using Simplices = std::vector<std::vector<std::uint32_t>>;

  explicit Pulling(const CellComplex& complex) {
    const auto number = [&](const auto& cells) {
      for (const auto& entry : cells) {
        ids_.emplace(entry.second, static_cast<std::uint32_t>(ids_.size()));
      }
    };
    number(complex.interior_simplex_cell_map(0));
    if (!complex.boundary_simplex_cell_maps().empty()) number(complex.boundary_simplex_cell_map(0));
  }
  std::uint32_t IdOf(Cell* vertex) const { return ids_.at(vertex); }

  const Simplices& Cut(Cell* cell) {
    if (const auto known = cut_.find(cell); known != cut_.end()) return known->second;
    Simplices simplices;
    if (const auto vertex = ids_.find(cell); vertex != ids_.end()) {
      simplices = {{vertex->second}};
    } else {
      std::uint32_t apex = ~0u;
      for (const auto& [facet, incidence] : cell->get_boundary())
        apex = std::min(apex, Lowest(facet));
      for (const auto& [facet, incidence] : cell->get_boundary()) {
        if (Holds(facet, apex)) continue;
        for (std::vector<std::uint32_t> simplex : Cut(facet)) {
          simplex.push_back(apex);
          simplices.push_back(std::move(simplex));
        }
      }
    }
    return cut_.emplace(cell, std::move(simplices)).first->second;
  }

 private:
  std::uint32_t Lowest(Cell* cell) {
    std::uint32_t lowest = ~0u;
    for (const auto& simplex : Cut(cell)) {
      lowest = std::min(lowest, *std::min_element(simplex.begin(), simplex.end()));
    }
    return lowest;
  }
  // Only the lowest vertex of a cell around it is asked for, which is then its own lowest.
  bool Holds(Cell* cell, std::uint32_t apex) { return Lowest(cell) == apex; }

  std::unordered_map<Cell*, std::uint32_t> ids_;
  std::unordered_map<Cell*, Simplices> cut_;
};

}  // namespace

Outcome MeshWithGudhiCoxeter(const Task& task, Meter& meter) {
  const std::unique_ptr<Manifold> manifold = testing::Make(task.manifold);
  const int d = std::max(task.ambient_dimension, manifold->ambient_dimension());
  const int k = manifold->dimension();

  Outcome outcome;
  const Function function(*manifold, d, &outcome.evaluations);
  // Turned and shifted at random, for the triangulation must be in general position.
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto entry = [&] { return normal(random); };
  const Eigen::MatrixXd turn =
      Eigen::HouseholderQR<Eigen::MatrixXd>(Eigen::MatrixXd::NullaryExpr(d, d, entry))
          .householderQ();
  const Eigen::VectorXd shift = Eigen::VectorXd::NullaryExpr(d, entry);
  // Where it is coarse it may meet nothing near one point of the manifold.
  const Eigen::MatrixXd near =
      manifold
          ->ClosestPoint(Eigen::MatrixXd::NullaryExpr(manifold->ambient_dimension(), kSeeds, entry))
          .points;
  std::vector<Eigen::VectorXd> seeds(kSeeds, Eigen::VectorXd::Zero(d));
  for (int i = 0; i < kSeeds; ++i) {
    seeds[static_cast<std::size_t>(i)].head(near.rows()) = near.col(i);
  }

  const Eigen::VectorXd pole = PoleOf(*manifold);

  meter.Start();
  Triangulation triangulation(static_cast<std::size_t>(d));
  triangulation.change_matrix(task.size * turn * triangulation.matrix());
  triangulation.change_offset(shift);
  Tracing::Out_simplex_map met, met_by_boundary;
  CellComplex complex(static_cast<std::size_t>(k));
  if (task.clip) {
    const Beyond domain(pole, *task.clip, d, &outcome.evaluations);
    Tracing().manifold_tracing_algorithm(
        seeds, triangulation, coxeter::make_oracle(function, domain), met, met_by_boundary);
    complex.construct_complex(met, met_by_boundary);
  } else {
    Tracing().manifold_tracing_algorithm(seeds, triangulation, coxeter::make_oracle(function), met);
    complex.construct_complex(met);
  }
  meter.Stop();

  Pulling pulling(complex);
  outcome.points.resize(d, static_cast<Eigen::Index>(complex.cell_point_map().size()));
  for (const auto& [vertex, point] : complex.cell_point_map()) {
    outcome.points.col(pulling.IdOf(vertex)) = point;
  }
  for (const auto& entry_of_cell : complex.interior_simplex_cell_map(static_cast<std::size_t>(k))) {
    for (const auto& simplex : pulling.Cut(entry_of_cell.second)) {
      outcome.simplices.insert(outcome.simplices.end(), simplex.begin(), simplex.end());
    }
  }
  outcome.note =
      std::to_string(complex.interior_simplex_cell_map(static_cast<std::size_t>(k)).size()) +
      " cells";
  return outcome;
}

}  // namespace stellate::bench
