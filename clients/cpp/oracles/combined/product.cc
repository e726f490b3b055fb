#include <algorithm>

#include "oracles/combined/common.h"
#include "stellate/oracles/combined.h"

namespace stellate::oracles {
namespace {

// Of one factor, for the seeds of the product: where it has only a box, a point of that.
Eigen::MatrixXd SeedsOf(const Oracle& factor) {
  Eigen::MatrixXd seeds = factor.seeds();
  const std::optional<BoundingBox> box = factor.bounding_box();
  if (seeds.size() > 0 || !box) return seeds;
  Eigen::VectorXd seed = (box->lower + box->upper) / 2;
  seed[0] += 0.37 * (box->upper[0] - box->lower[0]);  // the middle may be as near to all of it
  return seed;
}

}  // namespace

Product::Product(std::vector<std::shared_ptr<Oracle>> factors) : factors_(std::move(factors)) {
  if (factors_.size() < 2) {
    Refuse("a product needs two factors at least, and has " + std::to_string(factors_.size()));
  }
  for (const auto& factor : factors_) {
    if (factor == nullptr) Refuse("a factor of a product is null");
    RefuseWalls(*factor, "a product");
    dimension_ += factor->dimension();
    ambient_dimension_ += factor->ambient_dimension();
  }
}

Answer Product::ClosestPoint(const Eigen::MatrixXd& x) {
  Answer answer;
  answer.points.resize(x.rows(), x.cols());
  answer.found.assign(static_cast<size_t>(x.cols()), 1);
  Eigen::Index row = 0;
  for (const auto& factor : factors_) {
    const int d = factor->ambient_dimension();
    const Answer part = factor->ClosestPoint(x.middleRows(row, d));
    answer.points.middleRows(row, d) = part.points;
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      if (!part.IsFound(j)) answer.found[static_cast<size_t>(j)] = 0;
    }
    row += d;
  }
  return answer;
}

bool Product::has_tangent_basis() const {
  return std::all_of(factors_.begin(), factors_.end(),
                     [](const auto& factor) { return factor->has_tangent_basis(); });
}

Eigen::MatrixXd Product::TangentBasis(const Eigen::MatrixXd& points) {
  Eigen::MatrixXd bases = Eigen::MatrixXd::Zero(ambient_dimension() * dimension(), points.cols());
  int row = 0, column = 0;
  for (const auto& factor : factors_) {
    const int d = factor->ambient_dimension(), k = factor->dimension();
    const Eigen::MatrixXd part = factor->TangentBasis(points.middleRows(row, d));
    for (Eigen::Index j = 0; j < points.cols(); ++j) {
      Eigen::Map<RowMajor>(bases.col(j).data(), ambient_dimension(), dimension())
          .block(row, column, d, k) = Eigen::Map<const RowMajor>(part.col(j).data(), d, k);
    }
    row += d;
    column += k;
  }
  return bases;
}

bool Product::has_local_size() const {
  return std::all_of(factors_.begin(), factors_.end(),
                     [](const auto& factor) { return factor->has_local_size(); });
}

Eigen::VectorXd Product::LocalSize(const Eigen::MatrixXd& points) {
  Eigen::VectorXd sizes;
  int row = 0;
  for (const auto& factor : factors_) {
    const int d = factor->ambient_dimension();
    const Eigen::VectorXd part = factor->LocalSize(points.middleRows(row, d));
    sizes = row == 0 ? part : Eigen::VectorXd(sizes.cwiseMin(part));
    row += d;
  }
  return sizes;
}

std::optional<BoundingBox> Product::bounding_box() const {
  BoundingBox box{Eigen::VectorXd(ambient_dimension_), Eigen::VectorXd(ambient_dimension_)};
  int row = 0;
  for (const auto& factor : factors_) {
    const std::optional<BoundingBox> part = factor->bounding_box();
    if (!part) return std::nullopt;
    box.lower.segment(row, part->lower.size()) = part->lower;
    box.upper.segment(row, part->upper.size()) = part->upper;
    row += factor->ambient_dimension();
  }
  return box;
}

// Every seed of one with every seed of the others, if any factor has seeds.
std::string Product::about() const { return AboutOf(factors_); }

Eigen::MatrixXd Product::seeds() const {
  const auto has_seeds = [](const auto& factor) { return factor->seeds().size() > 0; };
  if (std::none_of(factors_.begin(), factors_.end(), has_seeds)) return {};
  Eigen::MatrixXd all(0, 1);
  for (const auto& factor : factors_) {
    const Eigen::MatrixXd part = SeedsOf(*factor);
    if (part.size() == 0) return {};
    Eigen::MatrixXd next(all.rows() + part.rows(), all.cols() * part.cols());
    for (Eigen::Index i = 0; i < all.cols(); ++i) {
      for (Eigen::Index j = 0; j < part.cols(); ++j) {
        next.col(i * part.cols() + j) << all.col(i), part.col(j);
      }
    }
    all = std::move(next);
  }
  return all;
}

}  // namespace stellate::oracles
