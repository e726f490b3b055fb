// Every oracle answers a batch without a question, which others that are made of it may ask.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "stellate/catalogue.h"
#include "stellate/oracles/combined.h"
#include "stellate/oracles/walls.h"
#include "support/ready_oracles.h"

namespace stellate::oracles {
namespace {

// What all methods answer to no question: nothing, of the right shape.
void AnswersNoRows(Oracle& oracle) {
  const Eigen::Index d = oracle.ambient_dimension(), k = oracle.dimension();
  const Eigen::MatrixXd none(d, 0);
  const auto is_empty = [d](const Answer& answer) {
    return answer.points.rows() == d && answer.points.cols() == 0 && answer.found.empty();
  };
  EXPECT_TRUE(is_empty(oracle.ClosestPoint(none)));
  if (oracle.has_tangent_basis()) {
    const Eigen::MatrixXd bases = oracle.TangentBasis(none);
    EXPECT_TRUE(bases.rows() == d * k && bases.cols() == 0);
  }
  if (oracle.has_intersect_flat()) {
    EXPECT_TRUE(is_empty(oracle.IntersectFlat(none, Eigen::MatrixXd(d * k, 0), Eigen::VectorXd())));
  }
  if (oracle.has_local_size()) {
    EXPECT_EQ(oracle.LocalSize(none).size(), 0);
  }
  if (oracle.equations() > 0) {
    const Eigen::MatrixXd gradients = oracle.EquationGradients(none);
    EXPECT_TRUE(gradients.rows() == oracle.equations() * d && gradients.cols() == 0);
  }
  for (int wall = 0; wall < oracle.walls(); ++wall) {
    EXPECT_TRUE(is_empty(oracle.FacePoint(none, {wall})));
    const Eigen::MatrixXd conormals = oracle.Conormals(none, {wall});
    EXPECT_TRUE(conormals.rows() == d && conormals.cols() == 0);
  }
  if (oracle.walls() > 0) {
    const Eigen::MatrixXd clearances = oracle.Clearances(none);
    EXPECT_TRUE(clearances.rows() == oracle.walls() && clearances.cols() == 0);
  }
}

TEST(ReadyOracles, AnswerNoRowsWithNoRows) {
  for (const std::string& name : testing::ReadyOracles()) {
    SCOPED_TRACE(name);
    AnswersNoRows(*testing::MakeReadyOracle(name));
  }
}

TEST(Walls, AnswerNoRowsWithNoRows) {
  for (const CatalogueEntry& entry : ListDomains()) {
    SCOPED_TRACE(entry.example);
    AnswersNoRows(*MakeDomain(entry.example).value());
  }
  Similarity into_space{Eigen::MatrixXd::Identity(3, 2), 1, {}};
  const auto rim = std::make_shared<Transformed>(MakeManifold("sphere:1").value(), into_space);
  for (const bool all : {true, false}) {
    const auto up = [](const Eigen::VectorXd& x) { return x[2]; };
    ManifoldWithBoundary half(MakeManifold("sphere:2").value(), rim,
                              all ? ManifoldWithBoundary::Clearance(up) : nullptr);
    AnswersNoRows(half);
  }
}

TEST(Catalogue, AnswersNoRowsWithNoRows) {
  for (const CatalogueEntry& entry : ListManifolds()) {
    SCOPED_TRACE(entry.example);
    AnswersNoRows(*MakeManifold(entry.example).value());
  }
}

}  // namespace
}  // namespace stellate::oracles
