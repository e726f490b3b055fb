#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/run/asker.h"
#include "core/run/tangent_finder.h"

namespace stellate::core {

// Two points of M, and orthonormal bases of M's tangent spaces there, d x k.
struct Way {
  Eigen::VectorXd a, b;
  Eigen::MatrixXd at_a, at_b;

  double length() const { return (b - a).norm(); }
};

// The sine of the largest angle between the spaces that two orthonormal bases span, d x k each.
double SineBetween(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other);

// Where M's tangent spaces turn within no distance.
struct Crease {
  Eigen::VectorXd point;  // on M, or within `length` of it
  double sine = 0;        // of the angle by which they turn
  double length = 0;      // between the two points that show it
  bool crosses = false;   // M goes on beyond it to all sides, and is no crease or corner
};

// Whether M is smooth where rules keep failing: walks from ways along which its tangent spaces
// turn to ways that are ever shorter. Where M is smooth they turn less, whatever M's reach and the
// mesh size are; where they turn as much on a way thousands of times as short there is a crease, a
// corner or a crossing. It asks for closest points, and tangents where they are given.
class CreaseProbe final : public Asker {
 public:
  // k, d: dimensions of M and of space. gives_tangents, has_walls: as the oracle has them.
  CreaseProbe(int k, int d, bool gives_tangents, bool has_walls, std::uint64_t seed);

  // Begins anew, from these; nothing found so far.
  void Start(std::vector<Way> ways);
  void Stop() { Start({}); }

  // Empty: it knows.
  std::vector<QueryBlock> Questions() override;
  // The first of the answers is to its question.
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool is_asking() const { return !walks_.empty() && !crease_; }
  const std::optional<Crease>& crease() const { return crease_; }

 private:
  enum class Stage { kPoints, kTangents, kSteps };
  struct Node {
    Eigen::VectorXd point;
    Eigen::MatrixXd basis;
  };
  struct Walk {
    Way way;
    double first_length = 0, sine = 0;
    int legs = 0;
    std::vector<Node> nodes;   // what was found about it last, the way's ends among them
    std::vector<Node> before;  // on earlier legs
  };

  Eigen::MatrixXd PointsAbout(const Way& way) const;
  Eigen::MatrixXd StepsFrom(const Way& way) const;
  void TakePoints(const AnswerBlock& answer);
  void TakeTangents();
  void GoOn();
  bool TakeLeg(Walk* walk) const;
  bool IsSettled(const Walk& walk) const;
  void TakeSteps(const AnswerBlock& answer);

  int k_, d_;
  bool gives_tangents_, has_walls_;
  TangentFinder finder_;
  Stage stage_ = Stage::kPoints;
  std::vector<Walk> walks_;
  std::vector<std::size_t> walk_of_;  // by point whose tangents are being found
  Eigen::MatrixXd found_;             // those points
  std::optional<Crease> crease_;
};

}  // namespace stellate::core
