#pragma once

#include <Eigen/Core>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <set>
#include <vector>

#include "core/certificate/certifier.h"
#include "core/certificate/complex/topology.h"

namespace stellate::core {

// A mesh made by hand, to be certified or broken.
struct HandmadeMesh {
  int k = 0, d = 0;
  std::vector<double> points;    // n x d
  std::vector<double> tangents;  // n x k x d
  std::vector<std::uint32_t> simplices;

  std::uint32_t vertices() const { return static_cast<std::uint32_t>(points.size()) / d; }
  std::size_t size() const { return simplices.size() / (k + 1); }
  MeshView View() const { return {k, d, vertices(), points.data(), tangents.data(), &simplices}; }
  SimplexList List() const { return {k, vertices(), &simplices}; }
  Eigen::Map<const Eigen::VectorXd> Point(std::uint32_t v) const {
    return {points.data() + std::size_t{v} * d, d};
  }

  std::uint32_t AddVertex(const Eigen::VectorXd& p, const Eigen::MatrixXd& tangent) {
    d = static_cast<int>(p.size());
    k = static_cast<int>(tangent.cols());
    points.insert(points.end(), p.begin(), p.end());
    tangents.insert(tangents.end(), tangent.data(), tangent.data() + d * k);
    return vertices() - 1;
  }
  void AddSimplex(std::vector<std::uint32_t> ids) {
    std::sort(ids.begin(), ids.end());
    simplices.insert(simplices.end(), ids.begin(), ids.end());
  }
  void RemoveSimplex(std::size_t s) {
    simplices.erase(simplices.begin() + s * (k + 1), simplices.begin() + (s + 1) * (k + 1));
  }
  // Renames vertex `from` to `to` in all simplices; `from` stays behind without any.
  void Merge(std::uint32_t from, std::uint32_t to) {
    for (std::size_t s = 0; s < size(); ++s) {
      std::uint32_t* ids = simplices.data() + s * (k + 1);
      std::replace(ids, ids + k + 1, from, to);
      std::sort(ids, ids + k + 1);
    }
  }
  void Append(const HandmadeMesh& other) {
    const std::uint32_t shift = vertices();
    points.insert(points.end(), other.points.begin(), other.points.end());
    tangents.insert(tangents.end(), other.tangents.begin(), other.tangents.end());
    for (const std::uint32_t id : other.simplices) simplices.push_back(id + shift);
  }
};

// An orthonormal basis of the complement of unit vector n.
inline Eigen::MatrixXd Complement(const Eigen::VectorXd& n) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(n);
  const Eigen::MatrixXd q = qr.householderQ();
  return q.rightCols(n.size() - 1);
}

// The cross-polytope's boundary, on the unit k-sphere: 2 (k+1) vertices.
inline HandmadeMesh CrossPolytope(int k) {
  HandmadeMesh mesh;
  for (int i = 0; i <= k; ++i) {
    for (const double sign : {1.0, -1.0}) {
      const Eigen::VectorXd p = sign * Eigen::VectorXd::Unit(k + 1, i);
      mesh.AddVertex(p, Complement(p));
    }
  }
  for (unsigned mask = 0; mask < 1u << (k + 1); ++mask) {
    std::vector<std::uint32_t> ids;
    for (int i = 0; i <= k; ++i) ids.push_back(2 * i + (mask >> i & 1));
    mesh.AddSimplex(ids);
  }
  return mesh;
}

// The boundary of the regular (k+1)-simplex, on the unit k-sphere.
inline HandmadeMesh SimplexBoundary(int k) {
  HandmadeMesh mesh;
  const int n = k + 2;
  // The simplex spanned by the unit vectors of R^n, seen in the hyperplane that holds it.
  const Eigen::MatrixXd frame = Complement(Eigen::VectorXd::Ones(n).normalized());
  for (int i = 0; i < n; ++i) {
    const Eigen::VectorXd p = (frame.transpose() * Eigen::VectorXd::Unit(n, i)).normalized();
    mesh.AddVertex(p, Complement(p));
  }
  for (int omit = 0; omit < n; ++omit) {
    std::vector<std::uint32_t> ids;
    for (int i = 0; i < n; ++i) {
      if (i != omit) ids.push_back(i);
    }
    mesh.AddSimplex(ids);
  }
  return mesh;
}

// The octahedron on the unit sphere, each triangle cut in four `levels` times.
inline HandmadeMesh Icosphere(int levels) {
  HandmadeMesh mesh = CrossPolytope(2);
  for (int level = 0; level < levels; ++level) {
    HandmadeMesh finer;
    finer.k = 2;
    finer.d = 3;
    finer.points = mesh.points;
    finer.tangents = mesh.tangents;
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const std::array<std::uint32_t, 2> key{std::min(a, b), std::max(a, b)};
      const auto [place, fresh] = middles.try_emplace(key, 0);
      if (fresh) {
        const Eigen::VectorXd p = (mesh.Point(a) + mesh.Point(b)).normalized();
        place->second = finer.AddVertex(p, Complement(p));
      }
      return place->second;
    };
    for (std::size_t s = 0; s < mesh.size(); ++s) {
      const std::uint32_t* t = &mesh.simplices[3 * s];
      const std::uint32_t ab = middle(t[0], t[1]), bc = middle(t[1], t[2]), ca = middle(t[2], t[0]);
      finer.AddSimplex({t[0], ab, ca});
      finer.AddSimplex({t[1], ab, bc});
      finer.AddSimplex({t[2], bc, ca});
      finer.AddSimplex({ab, bc, ca});
    }
    mesh = finer;
  }
  return mesh;
}

// A grid on the torus R^k / Z^k, n cells a side, cut into simplices by Freudenthal's (Kuhn's)
// rule. `place` maps angles in [0, 2 pi)^k to a point and its tangent basis. `flip` makes the
// first coordinate cross its end with the second one reversed: a Klein bottle for k = 2.
inline HandmadeMesh TorusGrid(
    int k, int n,
    const std::function<std::pair<Eigen::VectorXd, Eigen::MatrixXd>(const Eigen::VectorXd&)>& place,
    bool flip = false) {
  HandmadeMesh mesh;
  int count = 1;
  for (int i = 0; i < k; ++i) count *= n;
  for (int v = 0; v < count; ++v) {
    Eigen::VectorXd angles(k);
    for (int i = 0, rest = v; i < k; ++i, rest /= n) {
      angles[i] = 2 * std::numbers::pi * (rest % n) / n;
    }
    const auto [p, tangent] = place(angles);
    mesh.AddVertex(p, tangent);
  }
  std::vector<int> order(k);
  for (int v = 0; v < count; ++v) {
    std::vector<int> cell(k);
    for (int i = 0, rest = v; i < k; ++i, rest /= n) cell[i] = rest % n;
    for (int i = 0; i < k; ++i) order[i] = i;
    do {
      std::vector<std::uint32_t> ids;
      std::vector<int> corner = cell;
      for (int step = 0; step <= k; ++step) {
        std::vector<int> wrapped = corner;
        if (flip && wrapped[0] >= n) wrapped[1] = n - wrapped[1];
        std::uint32_t id = 0;
        for (int i = k - 1; i >= 0; --i) id = id * n + (wrapped[i] % n + n) % n;
        ids.push_back(id);
        if (step < k) ++corner[order[step]];
      }
      mesh.AddSimplex(ids);
    } while (std::next_permutation(order.begin(), order.end()));
  }
  return mesh;
}

// The flat torus T^k in R^2k, the product of k unit circles: reach 1.
inline std::pair<Eigen::VectorXd, Eigen::MatrixXd> CliffordPoint(const Eigen::VectorXd& angles) {
  const Eigen::Index k = angles.size();
  Eigen::VectorXd p(2 * k);
  Eigen::MatrixXd tangent = Eigen::MatrixXd::Zero(2 * k, k);
  for (Eigen::Index i = 0; i < k; ++i) {
    p[2 * i] = std::cos(angles[i]);
    p[2 * i + 1] = std::sin(angles[i]);
    tangent(2 * i, i) = -std::sin(angles[i]);
    tangent(2 * i + 1, i) = std::cos(angles[i]);
  }
  return {p, tangent};
}

// The torus of revolution in R^3 around the z axis.
inline std::pair<Eigen::VectorXd, Eigen::MatrixXd> RevolutionPoint(double big, double small,
                                                                   const Eigen::VectorXd& angles) {
  const double u = angles[0], v = angles[1];
  const double r = big + small * std::cos(v);
  Eigen::VectorXd p(3);
  p << r * std::cos(u), r * std::sin(u), small * std::sin(v);
  Eigen::MatrixXd tangent(3, 2);
  tangent << -std::sin(u), -std::sin(v) * std::cos(u),  //
      std::cos(u), -std::sin(v) * std::sin(u),          //
      0, std::cos(v);
  return {p, tangent};
}

using ClosestPoint = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

inline Eigen::VectorXd ClosestOnSphere(const Eigen::VectorXd& x) { return x.normalized(); }

inline Eigen::VectorXd ClosestOnClifford(const Eigen::VectorXd& x) {
  Eigen::VectorXd y(x.size());
  for (Eigen::Index i = 0; i < x.size(); i += 2) {
    y.segment<2>(i) = x.segment<2>(i).normalized();
  }
  return y;
}

inline Eigen::VectorXd ClosestOnRevolution(double big, double small, const Eigen::VectorXd& x) {
  Eigen::VectorXd ring(3);
  ring << x[0], x[1], 0;
  ring = big * ring.normalized();
  return ring + small * (x - ring).normalized();
}

inline Specification SpecificationFor(const HandmadeMesh& mesh, double epsilon) {
  Specification spec;
  spec.dimension = mesh.k;
  spec.ambient_dimension = mesh.d;
  spec.epsilon = epsilon;
  return spec;
}

struct CertifiedRun {
  Certificate certificate;
  int rounds = 0;
  Eigen::Index queries = 0;
};

// `tangent` answers for the oracle when spec.oracle.tangent_basis is set.
inline CertifiedRun Certify(
    const Specification& spec, const HandmadeMesh& mesh, const ClosestPoint& closest,
    StarFacts facts = {0, 0, true},
    const std::function<Eigen::MatrixXd(const Eigen::VectorXd&)>& tangent = nullptr,
    KnownOfManifold known = {}) {
  CertifiedRun run;
  const std::unique_ptr<Certifier> certifier =
      Certifier::Create(spec, mesh.View(), facts, std::move(known));
  for (std::vector<QueryBlock> blocks; !(blocks = certifier->Questions()).empty();) {
    ++run.rounds;
    std::vector<AnswerBlock> answers;
    for (const QueryBlock& block : blocks) {
      AnswerBlock answer;
      answer.points.resize(block.points.rows(), block.size());
      for (Eigen::Index j = 0; j < block.size(); ++j) {
        const Eigen::VectorXd y = closest(block.points.col(j));
        answer.found.push_back(y.size() > 0);  // an empty vector says "not found"
        if (y.size() == 0) continue;
        answer.points.col(j) = y;
        if (!block.want.tangents) continue;
        answer.tangents.resize(mesh.d * mesh.k, block.size());
        const Eigen::MatrixXd basis = tangent(y);
        for (int i = 0; i < mesh.d; ++i) {
          for (int a = 0; a < mesh.k; ++a) answer.tangents(i * mesh.k + a, j) = basis(i, a);
        }
      }
      run.queries += block.size();
      answers.push_back(std::move(answer));
    }
    certifier->Absorb(answers);
  }
  run.certificate = certifier->certificate();
  return run;
}

}  // namespace stellate::core
