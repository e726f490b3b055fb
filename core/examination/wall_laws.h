#pragma once

#include <functional>
#include <initializer_list>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/examination/probe.h"
#include "core/examination/task.h"
#include "core/examination/words.h"

namespace stellate::core::examination {

// The laws of an oracle's walls; what breaks one is given to `add`.
//
//   WallLaws laws(probe, add);
//   co_await laws.Obey();
//   const double reach = co_await laws.Reach();
class WallLaws {
 public:
  WallLaws(Probe& probe, std::function<void(Finding)> add);

  Task<> Obey();
  // Returns the boundary's reach, by Federer's quotient on each wall.
  Task<double> Reach();

 private:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  // What is known of points of one wall's face.
  struct Face {
    int wall = 0;
    Matrix points;
    std::vector<Basis> bases;
    Matrix slopes;  // k x n: how the wall's value changes along M
    FaceAnswers at;
  };

  void Add(const std::string& code, std::initializer_list<Value> values) {
    add_(MakeFinding(code, values));
  }
  // The laws of one wall at points of its face; gives those of them that lie in M.
  Task<Matrix> One(int wall, Matrix found);
  Task<Matrix> OnManifold(int wall, Matrix found);
  Matrix Judge(const Face& face);
  void JudgeConormal(int wall, const Vector& y, const Basis& basis, const Vector& n,
                     const Vector& slope);
  // Bisects between samples on both sides of each wall that has no known point.
  Task<bool> Crosses(int wall);
  // The nearest two samples on the two sides; no columns: there are none.
  Matrix Astride(const Vector& value) const;
  Task<Matrix> Slopes(int wall, Matrix y, std::vector<Basis> bases);
  // From near a point of the face that, or a nearer one, is the nearest.
  Task<> Closest(int wall, Matrix y);
  // The laws of two walls where they meet inside the others.
  Task<> Two(int wall, int other, Matrix found);
  void JudgeAngles(int wall, int other, const Matrix& y, const FaceAnswers& at);
  Task<> AnythingLeft();

  Probe& probe_;
  const std::function<void(Finding)> add_;
  const double slack_;
  std::vector<Matrix> points_;  // of each wall, those of its face that lie in M
};

}  // namespace stellate::core::examination
