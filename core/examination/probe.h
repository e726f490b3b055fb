#pragma once

#include <Eigen/Core>
#include <coroutine>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/batch.h"
#include "core/examination/task.h"
#include "core/specification.h"

namespace stellate::core::examination {

using Found = Eigen::Array<bool, Eigen::Dynamic, 1>;
using Basis = Eigen::MatrixXd;  // d x k
using Indices = std::vector<Eigen::Index>;

struct Answered {
  Eigen::MatrixXd points;  // a column for each query; the query itself where nothing was found
  Found found;
};

// What an answer on a face says besides its point.
struct FaceAnswers {
  Eigen::MatrixXd clearances;  // walls x n
  Eigen::MatrixXd conormals;   // d x n, of the face's first wall
  Eigen::MatrixXd others;      // d x n, of its second wall, if there is one
};

// The oracle's side of a probe: the queries that a task waits with, until Reply has their answers.
class Mailbox {
 public:
  // Awaited, gives the answers to a block: all arrays that it wants, and `found` for each query.
  struct Asking {
    bool await_ready() const noexcept { return block.size() == 0; }
    void await_suspend(std::coroutine_handle<> task) { box->Wait(&block, task); }
    AnswerBlock await_resume() { return std::move(box->answer_); }

    Mailbox* box;
    QueryBlock block;
  };

  Asking Ask(QueryBlock block) {
    answer_ = {};
    return {this, std::move(block)};
  }
  // Null: no task waits for answers.
  const QueryBlock* waiting() const { return block_; }
  // Goes on with what waits. REQUIRES: something does.
  void Reply(AnswerBlock answer, double seconds) {
    answer_ = std::move(answer);
    seconds_ = seconds;
    block_ = nullptr;
    std::exchange(suspended_, {}).resume();
  }
  void Forget() { block_ = nullptr; }
  double seconds() const { return seconds_; }  // that the newest answers took; 0: not known

 private:
  void Wait(const QueryBlock* block, std::coroutine_handle<> task) {
    block_ = block;
    suspended_ = task;
  }

  const QueryBlock* block_ = nullptr;
  std::coroutine_handle<> suspended_;
  AnswerBlock answer_;
  double seconds_ = 0;
};

// An oracle under examination: queries in terms of M, and the geometry that is drawn from the
// answers. What is not finite in these is thrown as a Stop.
class Probe {
 public:
  explicit Probe(Specification spec) : spec_(std::move(spec)), random_(spec_.random_seed) {}

  const Specification& spec() const { return spec_; }
  int k() const { return spec_.dimension; }
  int d() const { return spec_.ambient_dimension; }
  int walls() const { return spec_.walls; }
  bool fills_space() const { return k() == d(); }

  Task<Answered> Closest(Eigen::MatrixXd x);
  Task<Answered> Intersect(Eigen::MatrixXd centers, std::vector<Basis> bases,
                           Eigen::VectorXd radii);
  Task<std::vector<Basis>> GivenTangents(Eigen::MatrixXd points);
  Task<Eigen::VectorXd> GivenSizes(Eigen::MatrixXd points);
  Task<Answered> FacePoints(Eigen::MatrixXd x, WallSet face);
  Task<Eigen::MatrixXd> Clearances(Eigen::MatrixXd points);  // walls x n
  Task<FaceAnswers> OnFace(Eigen::MatrixXd points, WallSet face);
  // Asks for the closest points of these without a look at the answers; returns the seconds.
  Task<double> Time(Eigen::MatrixXd x);

  // At points of M the derivative of the closest point map is the projection on the tangent space.
  struct Moved {
    std::vector<Basis> bases;  // orthonormal, of the derivative's image
    std::vector<int> ranks;    // of the derivative
  };
  Task<Moved> Differential(Eigen::MatrixXd points);
  // The oracle's own bases where they are trusted, else from closest points.
  Task<std::vector<Basis>> TangentsAt(Eigen::MatrixXd points);
  // Pairs of neighbouring samples, those first whose tangent spaces differ most.
  Task<std::vector<std::pair<Eigen::Index, Eigen::Index>>> MostTurnedNeighbours();
  // Counts the components that samples lie on, as far as ways between neighbours show it: a way
  // leads along M where the closest points of a segment's points advance without a leap.
  Task<int> Pieces();

  // Returns where to look for M; no columns: the specification does not say where it is.
  Eigen::MatrixXd StartingPoints();
  // Returns random unit vectors at right angles to the columns of each basis, d x n.
  Eigen::MatrixXd Normals(const std::vector<Basis>& bases);
  Eigen::MatrixXd RandomMatrix(double size);        // d x k, of random entries in [-size, size]
  Eigen::MatrixXd RandomUnits(Eigen::Index count);  // d x count

  Mailbox box;
  Eigen::MatrixXd starts, points;     // queries, and the points of M that answer them
  Eigen::MatrixXd some;               // a part of the points, for the costly laws
  std::vector<Basis> moved_tangents;  // at these: how closest points move
  std::vector<int> ranks;             // in how many dimensions
  double size = 0;                    // the diagonal of the points' box
  bool trusts_given = false;          // the oracle's own tangents have proved right
  std::uint64_t queries = 0;

 private:
  Mailbox::Asking Ask(QueryBlock block);
  Answered Checked(const char* method, const Eigen::MatrixXd& x, AnswerBlock* answer) const;
  std::vector<std::pair<Eigen::Index, Eigen::Index>> Neighbours(int count) const;

  const Specification spec_;
  Random random_;
};

// Returns the columns of `x` with these indices.
inline Eigen::MatrixXd Take(const Eigen::MatrixXd& x, const Indices& columns) {
  return x(Eigen::all, columns);
}

// Returns every so many-th column, at most `count` of them.
Indices Spread(Eigen::Index columns, Eigen::Index count);

// Returns the median, 0 without values. Does not change `values`.
double Median(const Eigen::VectorXd& values);

// Returns the largest angle between the spaces that orthonormal bases span, in degrees.
double Turn(const Basis& a, const Basis& b);
double DegreesOfSine(double sine);      // of [0, 1]; larger is 90 degrees
double DegreesOfCosine(double cosine);  // of [-1, 1], or the nearest to it

// Returns Federer's |v|^2 / (2 dist(v, T)) for the way v from one point of M to another; infinite
// if it is too short to tell.
double ReachFrom(const Eigen::VectorXd& v, const Basis& tangent, double shortest);

}  // namespace stellate::core::examination
