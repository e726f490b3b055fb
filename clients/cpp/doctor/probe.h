#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "stellate/doctor.h"

namespace stellate::doctor {

// A finding that leaves nothing to go on with; thrown.
struct Stop {
  Finding finding;
};

using Found = Eigen::Array<bool, Eigen::Dynamic, 1>;
using Basis = Eigen::MatrixXd;  // d x k
using Indices = std::vector<Eigen::Index>;

Eigen::MatrixXd Orthonormal(const Eigen::MatrixXd& columns);  // a basis of what they span

struct Answered {
  Eigen::MatrixXd points;  // a column for each question
  Found found;
};

// An oracle under examination: the questions, and the geometry that is drawn from the answers.
// Every answer's shape and finiteness is looked at; what breaks is thrown as a Stop.
class Probe {
 public:
  Probe(Oracle& oracle, std::uint64_t random_seed);

  int k() const { return k_; }
  int d() const { return d_; }
  bool gives_tangents() const { return gives_tangents_; }
  bool intersects_flats() const { return oracle_.has_intersect_flat(); }
  bool gives_sizes() const { return oracle_.has_local_size(); }
  int walls() const { return walls_; }
  int equations() const { return oracle_.equations(); }
  bool fills_space() const { return k_ == d_; }

  Answered Closest(const Eigen::MatrixXd& x);
  Answered Intersect(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases,
                     const Eigen::VectorXd& radii);
  std::vector<Basis> GivenTangents(const Eigen::MatrixXd& points);
  Eigen::VectorXd GivenSizes(const Eigen::MatrixXd& points);
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points);
  // Of walls, as the oracle's own.
  Answered FacePoints(const Eigen::MatrixXd& x, const Walls& face);
  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points);
  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face);

  // Fills starts and points; `add` takes what is wrong with them.
  void FindPoints(const std::function<void(Finding)>& add);
  // Fills some, moved_tangents and ranks.
  void FindTangents();

  Eigen::MatrixXd starts, points;     // questions, and the points of M that answer them
  Eigen::MatrixXd some;               // a part of the points, for the costly laws
  std::vector<Basis> moved_tangents;  // at these: how closest points move
  std::vector<int> ranks;             // in how many dimensions
  double size = 0;                    // the diagonal of the points' box
  bool trusts_given = false;          // the oracle's own tangents have proved right
  std::uint64_t queries = 0;

  // The oracle's own bases where they are trusted, else from closest points.
  std::vector<Basis> TangentsAt(const Eigen::MatrixXd& points);
  // A random unit vector at right angles to the columns of each basis.
  Eigen::MatrixXd Normals(const std::vector<Basis>& bases);
  // Pairs of neighbouring samples, those first whose tangent spaces differ most.
  std::vector<std::pair<Eigen::Index, Eigen::Index>> MostTurnedNeighbours();
  // How many components the samples lie on, as far as ways between neighbours show it: a way
  // leads along M where the closest points of a segment's points advance without a leap.
  int Pieces();
  // A d x k matrix of random entries of about the given size.
  Eigen::MatrixXd RandomMatrix(double size);
  Eigen::MatrixXd RandomUnits(Eigen::Index count);  // d x count

 private:
  Eigen::MatrixXd StartingPoints();
  double Uniform(double low, double high);
  Eigen::MatrixXd Numbers(const char* method, const Eigen::MatrixXd& points, Eigen::Index rows,
                          const std::function<Eigen::MatrixXd()>& ask);
  std::vector<Basis> Differential(const Eigen::MatrixXd& points, std::vector<int>* ranks);
  std::vector<std::pair<Eigen::Index, Eigen::Index>> Neighbours(int count) const;
  Answered Checked(const char* method, const Answer& answer, Eigen::Index count) const;

  Oracle& oracle_;
  const int k_, d_, walls_;
  bool gives_tangents_;
  std::mt19937_64 random_;
};

// The columns of `x` that are named.
inline Eigen::MatrixXd Take(const Eigen::MatrixXd& x, const Indices& columns) {
  return x(Eigen::all, columns);
}

// The largest angle between the spaces that orthonormal bases span, in radians.
double Turn(const Basis& a, const Basis& b);

// Federer's |v|^2 / (2 dist(v, T)) for the way v from one point of M to another; infinite when
// too short to tell.
double ReachFrom(const Eigen::VectorXd& v, const Basis& tangent, double shortest);

}  // namespace stellate::doctor
