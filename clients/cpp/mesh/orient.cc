#include <Eigen/LU>
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "stellate/mesh.h"

namespace stellate {
namespace {

// One side of a simplex: the face left when vertex `opposite` (a row) is dropped.
struct Side {
  Eigen::Index simplex;
  Eigen::Index opposite;
};

// Compares and matches sides by the ids of their face. Ids ascend within a simplex, so the faces'
// ids do too.
class Faces {
 public:
  explicit Faces(const SimplexMatrix& simplices) : simplices_(simplices) {}

  int Compare(const Side& a, const Side& b) const {
    for (Eigen::Index i = 0; i + 1 < simplices_.rows(); ++i) {
      const std::uint32_t x = Id(a, i), y = Id(b, i);
      if (x != y) return x < y ? -1 : 1;
    }
    return 0;
  }

 private:
  std::uint32_t Id(const Side& side, Eigen::Index i) const {
    return simplices_(i < side.opposite ? i : i + 1, side.simplex);
  }
  const SimplexMatrix& simplices_;
};

// The other orientation.
void Turn(SimplexMatrix::ColXpr simplex) {
  std::swap(simplex[simplex.size() - 2], simplex[simplex.size() - 1]);
}

// With ids ascending, the face opposite row i is induced the orientation (-1)^i; two neighbours
// agree when they induce opposite ones on their common face.
bool SameSignAgrees(const Side& a, const Side& b) { return (a.opposite + b.opposite) % 2 != 0; }

// OrientedSimplices, and for each simplex the first of its component, where components hang
// together by faces; empty if the complex is not orientable.
SimplexMatrix Orient(const SimplexMatrix& simplices, std::vector<Eigen::Index>* component) {
  component->clear();
  const Eigen::Index m = simplices.cols(), width = simplices.rows();
  if (m == 0 || width < 2) return simplices;
  std::vector<Side> sides;
  sides.reserve(static_cast<size_t>(m * width));
  for (Eigen::Index j = 0; j < m; ++j) {
    for (Eigen::Index i = 0; i < width; ++i) sides.push_back({j, i});
  }
  const Faces faces(simplices);
  std::sort(sides.begin(), sides.end(),
            [&](const Side& a, const Side& b) { return faces.Compare(a, b) < 0; });
  // neighbour[j * width + i]: the side that shares the face opposite row i of simplex j.
  std::vector<Side> neighbour(static_cast<size_t>(m * width), Side{-1, 0});
  const auto slot = [&](const Side& s) {
    return static_cast<size_t>(s.simplex * width + s.opposite);
  };
  for (size_t i = 0; i < sides.size();) {
    size_t end = i + 1;
    while (end < sides.size() && faces.Compare(sides[i], sides[end]) == 0) ++end;
    if (end - i > 2) return simplices;  // not a pseudomanifold
    if (end - i == 2) {
      neighbour[slot(sides[i])] = sides[i + 1];
      neighbour[slot(sides[i + 1])] = sides[i];
    }
    i = end;
  }
  std::vector<int> sign(static_cast<size_t>(m), 0);
  std::vector<Eigen::Index> first(static_cast<size_t>(m), 0);
  std::vector<Eigen::Index> stack;
  for (Eigen::Index start = 0; start < m; ++start) {
    if (sign[static_cast<size_t>(start)] != 0) continue;
    sign[static_cast<size_t>(start)] = 1;
    stack.push_back(start);
    while (!stack.empty()) {
      const Eigen::Index j = stack.back();
      stack.pop_back();
      first[static_cast<size_t>(j)] = start;
      for (Eigen::Index i = 0; i < width; ++i) {
        const Side other = neighbour[slot({j, i})];
        if (other.simplex < 0) continue;
        const int own = sign[static_cast<size_t>(j)];
        const int wanted = SameSignAgrees({j, i}, other) ? own : -own;
        int& theirs = sign[static_cast<size_t>(other.simplex)];
        if (theirs == 0) {
          theirs = wanted;
          stack.push_back(other.simplex);
        } else if (theirs != wanted) {
          return simplices;  // a one-sided loop: not orientable
        }
      }
    }
  }
  SimplexMatrix oriented = simplices;
  for (Eigen::Index j = 0; j < m; ++j) {
    if (sign[static_cast<size_t>(j)] < 0) Turn(oriented.col(j));
  }
  *component = std::move(first);
  return oriented;
}

// Simplices that fill space, to positive volumes.
void TurnPositive(const Eigen::MatrixXd& points, SimplexMatrix* simplices) {
  const Eigen::Index d = points.rows();
  Eigen::MatrixXd sides(d, d);
  for (Eigen::Index j = 0; j < simplices->cols(); ++j) {
    for (Eigen::Index i = 0; i < d; ++i) {
      sides.col(i) = points.col((*simplices)(i + 1, j)) - points.col((*simplices)(0, j));
    }
    if (sides.determinant() < 0) Turn(simplices->col(j));
  }
}

}  // namespace

SimplexMatrix OrientedSimplices(const SimplexMatrix& simplices) {
  std::vector<Eigen::Index> component;
  return Orient(simplices, &component);
}

SimplexMatrix OrientedSimplices(const Mesh& mesh) {
  if (mesh.orientation) {
    SimplexMatrix told = mesh.simplices;
    for (Eigen::Index j = 0; j < told.cols() && mesh.orientation->orientable; ++j) {
      const auto s = static_cast<size_t>(j);
      if ((mesh.orientation->turned[s / 8] >> (s % 8) & 1) != 0) Turn(told.col(j));
    }
    return told;
  }
  const int d = mesh.ambient_dimension();
  if (mesh.is_boundary() && mesh.dimension() == d - 1) {
    SimplexMatrix outwards = mesh.simplices;
    for (Eigen::Index j = 0; j < outwards.cols(); ++j) {
      const Sides& sides = mesh.sides[static_cast<size_t>(j)];
      if (sides.behind < sides.ahead) Turn(outwards.col(j));
    }
    return outwards;
  }
  std::vector<Eigen::Index> component;
  SimplexMatrix oriented = Orient(mesh.simplices, &component);
  if (mesh.dimension() == d) TurnPositive(mesh.points, &oriented);
  if (component.empty() || mesh.dimension() != d - 1) return oriented;
  // d! times what each component encloses, as cones from the origin; below zero with normals
  // inwards.
  std::vector<double> volume(component.size(), 0);
  Eigen::MatrixXd corners(d, d);
  for (Eigen::Index j = 0; j < oriented.cols(); ++j) {
    for (int i = 0; i < d; ++i) corners.col(i) = mesh.points.col(oriented(i, j));
    volume[static_cast<size_t>(component[static_cast<size_t>(j)])] += corners.determinant();
  }
  for (Eigen::Index j = 0; j < oriented.cols(); ++j) {
    if (volume[static_cast<size_t>(component[static_cast<size_t>(j)])] < 0) Turn(oriented.col(j));
  }
  return oriented;
}

}  // namespace stellate
