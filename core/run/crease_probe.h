#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/boundary/boundary_policy.h"
#include "core/query_source.h"
#include "core/run/tangent_finder.h"

namespace stellate::core {

// Two points of M, and orthonormal bases of M's tangent spaces there, d x k.
struct Way {
  Eigen::VectorXd a, b;
  Eigen::MatrixXd at_a, at_b;

  double length() const { return (b - a).norm(); }
};

// Returns the sine of the largest angle between the spaces that two orthonormal bases span, d x k
// each.
double SineBetween(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other);

// A place where M's tangent space is discontinuous.
struct Crease {
  Eigen::VectorXd point;  // on M, or within `length` of it
  double sine = 0;        // of the angle by which they turn
  double length = 0;      // between the two points that show it
  bool crosses = false;   // M continues on all sides: it crosses itself, without a crease or tip
};

// Tests whether M is smooth where rules keep failing. It starts from ways (pairs of points) along
// which the tangent spaces turn, and bisects them down to a share of the mesh size. On a smooth M
// the tangent spaces turn less along shorter ways. If they turn as much, and M is straight on both
// sides, there is a crease, a corner, a tip or a crossing. Queries closest points, and tangents if
// the oracle gives them.
//
//   probe.Start(SteepWaysAtFaults<K>(engine, longest));
//   // ... drive it as a QuerySource, then:
//   if (probe.crease()) verdict += DescribeCrease(*probe.crease());
class CreaseProbe final : public QuerySource {
 public:
  explicit CreaseProbe(const Specification& spec);

  // Starts again, from these ways, and forgets what it found.
  void Start(std::vector<Way> ways);
  void Stop() { Start({}); }

  // Returns nothing once it is done.
  std::vector<QueryBlock> Questions() override;
  // Uses the first block of the answers.
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool is_asking() const { return !walks_.empty() && !crease_; }
  const std::optional<Crease>& crease() const { return crease_; }

 private:
  struct Node {
    Eigen::Index asked;  // the query that it answers; -1: none
    Eigen::VectorXd point;
    Eigen::MatrixXd basis;
  };
  struct Leg {
    Way way;
    double sine = 0;
    bool is_steep = false;  // turns nearly as much as the way before it
  };
  struct Walk {
    Way way;
    double sine = 0;
    int legs = 0;
    std::vector<Node> nodes = {};  // what was found about it last
    std::optional<Leg> next = {};
    bool ends_early = false, has_ended_early = false;
  };

  Eigen::MatrixXd PointsAbout(const Walk& walk) const;
  Eigen::MatrixXd StepsFrom(const Way& way) const;
  Walk& WalkOf(Eigen::Index asked);
  void TakePoints(const AnswerBlock& answer);
  void TakeTangents();
  void GoOn();
  bool GoesOn(Walk* walk) const;
  std::optional<Leg> NextLeg(const Walk& walk) const;
  static bool TakeLeg(Walk* walk);
  void LeaveEnd();
  std::optional<Crease> WhatIsAt(const Walk& walk);
  void TakeCorner(const AnswerBlock& answer);
  void ChooseEnd();

  int k_, d_;
  double size_;
  bool gives_tangents_;
  BoundaryPolicy policy_;
  TangentFinder finder_;
  bool is_difference_ = false;  // asks for tangents of what it has found
  bool looks_beyond_ = false;   // asks what is about the first walk's end
  std::vector<Walk> walks_;
  std::vector<Eigen::Index> asked_;     // the queries that have an answer
  Eigen::MatrixXd found_;               // those answers
  std::optional<Crease> unconfirmed_;   // a query tests whether M reaches its point
  std::optional<Eigen::VectorXd> tip_;  // where M may reach it otherwise
  double turn_ = 0;                     // the sine between its sides
  std::optional<Crease> crease_;
};

}  // namespace stellate::core
