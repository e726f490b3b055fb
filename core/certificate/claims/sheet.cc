#include "core/certificate/claims/sheet.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/dense.h"
#include "core/base/vector_ops.h"
#include "core/certificate/measure/small_solve.h"

namespace stellate::core {
namespace {

constexpr double kLessRounding = 1 - 0x1p-40;  // some thousand roundings of a squared distance

// Appends an orthonormal basis of the simplex's flat.
void AppendDirections(const MeshView& mesh, const std::uint32_t* ids, int count,
                      std::vector<double>* directions) {
  if (count == 1) return;
  Eigen::MatrixXd edges(mesh.d, count - 1);
  for (int r = 0; r + 1 < count; ++r)
    for (int i = 0; i < mesh.d; ++i)
      edges(i, r) = mesh.Point(ids[r + 1])[i] - mesh.Point(ids[0])[i];
  const Eigen::MatrixXd basis = OrthonormalBasis(edges, count - 1);
  directions->insert(directions->end(), basis.data(), basis.data() + basis.size());
}

}  // namespace

void Sheet::Add(const std::uint32_t* ids, std::pair<int, int> of) {
  const auto point = [&](int i) {
    return Eigen::Map<const Eigen::VectorXd>(mesh.Point(ids[i]), mesh.d);
  };
  Eigen::VectorXd barycentre = Eigen::VectorXd::Zero(mesh.d);
  for (int i = 0; i < mesh.k; ++i) barycentre += point(i);
  barycentre /= static_cast<double>(mesh.k);
  double radius = 0;
  for (int i = 0; i < mesh.k; ++i) radius = std::max(radius, (point(i) - barycentre).norm());
  simplices.insert(simplices.end(), ids, ids + mesh.k);
  sides.push_back(of);
  AppendDirections(mesh, ids, mesh.k, &directions);
  barycentres.insert(barycentres.end(), barycentre.begin(), barycentre.end());
  radii.push_back(radius);
  largest_radius = std::max(largest_radius, radius);
}

void Sheet::Index() { tree.Assign(radii); }

// From the nearest of the faces above or below which y lies: if that is the simplex itself, none is
// nearer.
double Sheet::SquaredDistanceFrom(std::uint32_t f, const double* y) const {
  const std::uint32_t* const ids = Ids(f);
  const unsigned whole = (1u << mesh.k) - 1;
  double nearest = INFINITY;
  for (unsigned mask = whole; mask > 0; --mask) {
    const double* corners[kMaxDimension + 1];
    int n = 0;
    for (int i = 0; i < mesh.k; ++i)
      if (mask >> i & 1u) corners[n++] = mesh.Point(ids[i]);
    const auto step = [&](const double* to, int i) { return to[i] - corners[0][i]; };
    SmallSystem system{};
    double along[kMaxDimension], away2 = SquaredDistance(y, corners[0], mesh.d);
    for (int r = 0; r + 1 < n; ++r) {
      along[r] = 0;
      for (int i = 0; i < mesh.d; ++i) along[r] += step(corners[r + 1], i) * step(y, i);
      system.b[r] = along[r];
      for (int c = 0; c + 1 < n; ++c)
        for (int i = 0; i < mesh.d; ++i)
          system.a[r][c] += step(corners[r + 1], i) * step(corners[c + 1], i);
    }
    if (n > 1 && system.Solve(n - 1) == 0) continue;
    double rest = 1;
    bool is_inside = true;
    for (int r = 0; r + 1 < n; ++r) {
      rest -= system.b[r];
      is_inside = is_inside && system.b[r] >= 0;
      away2 -= system.b[r] * along[r];
    }
    if (is_inside && rest >= 0) nearest = std::min(nearest, std::max(away2, 0.0));
    if (mask == whole && nearest < INFINITY) return nearest;
  }
  return nearest;
}

// Returns a lower bound of the squared distance from a simplex, which lies in a disc around its
// barycentre, in its own flat. So a large plane side is searched at the foot of y and not over all
// that is about as far.
double Sheet::SquaredBoundFrom(std::uint32_t f, const double* y) const {
  const int d = mesh.d, along = mesh.k - 1;
  const double* barycentre = barycentres.data() + f * static_cast<std::size_t>(d);
  const double* direction = directions.data() + f * static_cast<std::size_t>(along * d);
  double in_flat2 = 0;
  for (int r = 0; r < along; ++r, direction += d) {
    double step = 0;
    for (int i = 0; i < d; ++i) step += direction[i] * (y[i] - barycentre[i]);
    in_flat2 += step * step;
  }
  const double beyond = std::max(0.0, std::sqrt(in_flat2) - radii[f]);
  return (SquaredDistance(y, barycentre, d) - in_flat2 + beyond * beyond) * kLessRounding;
}

std::uint32_t Sheet::SomeNear(const double* y) const {
  std::optional<std::uint32_t> some;  // the nearest of the first leaf that is come to
  tree.VisitNear(
      y, [&] { return some ? 0.0 : double{INFINITY}; },
      [&](std::uint32_t f, double) {
        if (!some) some = f;
      });
  return *some;
}

// A simplex near y bounds the distance, so that few others are measured.
double Sheet::DistanceFrom(const double* y) const {
  if (is_empty()) return INFINITY;
  const std::uint32_t first = SomeNear(y);
  double best2 = SquaredDistanceFrom(first, y);
  std::vector<std::uint32_t> near;
  tree.Gather(y, std::sqrt(best2), &near);
  std::vector<std::pair<double, std::uint32_t>> bounds;
  for (const std::uint32_t f : near) {
    const double bound2 = f == first ? best2 : SquaredBoundFrom(f, y);
    if (bound2 < best2) bounds.emplace_back(bound2, f);
  }
  std::sort(bounds.begin(), bounds.end());
  for (const auto& [bound2, f] : bounds) {
    if (bound2 >= best2) break;
    best2 = std::min(best2, SquaredDistanceFrom(f, y));
  }
  return std::sqrt(best2);
}

}  // namespace stellate::core
