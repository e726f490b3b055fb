#include "core/certificate/sheet_claims.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/probes.h"
#include "core/certificate/small_solve.h"
#include "core/wall_beyond.h"

namespace stellate::core {
namespace {

// Questions of all walls together, and of each at least; of a wall that the mesh does not end at,
// where any answer tells.
constexpr std::size_t kMostQuestions = kMaxBarycentres;
constexpr std::size_t kLeastOfWall = 250;
constexpr std::size_t kMostOfUnmet = 100;

// The squared distance of y from a simplex: from the nearest of those of its faces above or below
// which y lies.
double SquaredDistanceFrom(const MeshView& mesh, const std::uint32_t* ids, int count,
                           const double* y) {
  double nearest = INFINITY;
  for (unsigned mask = 1; mask < 1u << count; ++mask) {
    const double* corners[kMaxDimension + 1];
    int n = 0;
    for (int i = 0; i < count; ++i)
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
  }
  return nearest;
}

// At most `most` of them, evenly.
std::vector<std::uint32_t> Thinned(const std::vector<std::uint32_t>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<std::uint32_t> some(most);
  for (std::size_t n = 0; n < most; ++n) some[n] = all[n * all.size() / most];
  return some;
}

}  // namespace

SheetClaims::SheetClaims(Examination& examination) : x_(examination) {
  for (int wall = 0; wall < x_.spec.walls; ++wall) sheets_.push_back(SheetOf(wall));
}

// From the corner of the simplex that ends at a facet to that, straight.
Eigen::VectorXd SheetClaims::OutwardAt(const std::uint32_t* facet) const {
  const int k = x_.mesh.k;
  for (const std::uint32_t s : x_.stars->Star(facet[0])) {
    const std::uint32_t* ids = x_.list()[s];
    if (!std::includes(ids, ids + k + 1, facet, facet + k)) continue;
    const std::uint32_t apex = *std::find_if(ids, ids + k + 1, [&](std::uint32_t v) {
      return !std::binary_search(facet, facet + k, v);
    });
    Eigen::VectorXd out = x_.Vertex(facet[0]) - x_.Vertex(apex);
    std::vector<Eigen::VectorXd> along;
    for (int i = 1; i < k; ++i) {
      Eigen::VectorXd edge = x_.Vertex(facet[i]) - x_.Vertex(facet[0]);
      for (const Eigen::VectorXd& other : along) edge -= other * other.dot(edge);
      along.push_back(edge.normalized());
      out -= along.back() * along.back().dot(out);
    }
    return out;
  }
  return Eigen::VectorXd::Zero(x_.mesh.d);  // none ends there, which is refused: it faces any way
}

std::unique_ptr<SheetClaims::Sheet> SheetClaims::SheetOf(int wall) const {
  auto sheet = std::make_unique<Sheet>(x_.mesh.d);
  const auto width = static_cast<std::size_t>(x_.mesh.k);
  for (const FaceMesh& face : *x_.mesh.faces)
    if (face.walls == SetOfWall(wall)) sheet->simplices = face.simplices;
  for (std::size_t s = 0; s < sheet->simplices.size(); s += width) {
    CheckInterruption(s);
    const std::uint32_t* ids = sheet->simplices.data() + s;
    Eigen::VectorXd barycentre = Eigen::VectorXd::Zero(x_.mesh.d);
    for (std::size_t i = 0; i < width; ++i) barycentre += x_.Vertex(ids[i]);
    barycentre /= static_cast<double>(width);
    double radius = 0;
    for (std::size_t i = 0; i < width; ++i)
      radius = std::max(radius, (x_.Vertex(ids[i]) - barycentre).norm());
    const Eigen::VectorXd outward = OutwardAt(ids);
    sheet->barycentres.insert(sheet->barycentres.end(), barycentre.begin(), barycentre.end());
    sheet->outward.insert(sheet->outward.end(), outward.begin(), outward.end());
    sheet->radii.push_back(radius);
    sheet->largest_radius = std::max(sheet->largest_radius, radius);
  }
  sheet->tree.Assign(sheet->radii);
  return sheet;
}

// Of the barycentres those to ask from, the farthest from the sheet first: a ball that reaches to
// the sheet is empty, or the answer tells, and what is in it needs no question of its own.
std::vector<std::uint32_t> SheetClaims::Spread(const Sheet& sheet,
                                               const Eigen::MatrixXd& barycentres,
                                               const std::vector<double>& radii) const {
  std::vector<std::uint32_t> order(radii.size());
  std::iota(order.begin(), order.end(), 0u);
  if (x_.thorough()) return order;
  if (sheet.radii.empty()) return Thinned(order, kMostOfUnmet);
  std::vector<double> far(radii.size());
  ParallelFor(radii.size(), [&](std::size_t n) {
    const double* at = barycentres.col(static_cast<Eigen::Index>(n)).data();
    far[n] = std::sqrt(sheet.tree.NearestSquaredDistance(at)) - sheet.largest_radius;
  });
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return far[a] > far[b]; });
  std::vector<std::uint32_t> balls, asked;
  for (const std::uint32_t n : order) {
    CheckInterruption(n);
    const double* at = barycentres.col(n).data();
    const bool is_in_ball = std::any_of(balls.begin(), balls.end(), [&](std::uint32_t ball) {
      return Distance(barycentres.col(ball).data(), at, x_.mesh.d) + radii[n] <= far[ball];
    });
    if (is_in_ball) continue;
    asked.push_back(n);
    if (far[n] > 0) balls.push_back(n);
  }
  return Thinned(asked,
                 std::max(kLeastOfWall, kMostQuestions / static_cast<std::size_t>(x_.spec.walls)));
}

std::vector<QueryBlock> SheetClaims::Questions(const std::vector<std::uint32_t>& chosen) {
  const Eigen::MatrixXd barycentres = PointsInside(x_.mesh, x_.list(), chosen, 1);
  std::vector<double> radii(chosen.size());
  ParallelFor(chosen.size(), [&](std::size_t n) {
    for (int i = 0; i <= x_.mesh.k; ++i)
      radii[n] = std::max(
          radii[n], Distance(x_.mesh.Point(x_.list()[chosen[n]][i]),
                             barycentres.col(static_cast<Eigen::Index>(n)).data(), x_.mesh.d));
  });
  std::vector<QueryBlock> blocks(sheets_.size());
  for (std::size_t wall = 0; wall < sheets_.size(); ++wall) {
    blocks[wall].face = SetOfWall(static_cast<int>(wall));
    blocks[wall].want_clearances = blocks[wall].want_tangents = true;
    blocks[wall].points = barycentres(Eigen::all, Spread(*sheets_[wall], barycentres, radii));
  }
  return blocks;
}

// Whether the mesh ends at a point of the wall, as the wall does there.
bool SheetClaims::Ends(const Sheet& sheet, const Eigen::VectorXd& y,
                       const Eigen::VectorXd& conormal) const {
  std::vector<std::uint32_t> near;
  sheet.tree.Gather(y.data(), x_.DistanceAllowed(sheet.largest_radius) + x_.position_error, &near);
  return std::any_of(near.begin(), near.end(), [&](std::uint32_t f) {
    const auto width = static_cast<std::size_t>(x_.mesh.k), d = static_cast<std::size_t>(x_.mesh.d);
    const double bound = x_.DistanceAllowed(sheet.radii[f]) + x_.position_error;
    return Dot(sheet.outward.data() + f * d, conormal.data(), x_.mesh.d) >= 0 &&
           SquaredDistanceFrom(x_.mesh, sheet.simplices.data() + f * width, x_.mesh.k, y.data()) <=
               bound * bound;
  });
}

void SheetClaims::Judge(std::size_t wall, const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
  const WallSet face = SetOfWall(static_cast<int>(wall));
  std::vector<std::uint8_t> is_missed(static_cast<std::size_t>(asked.cols()));
  ParallelFor(is_missed.size(), [&](std::size_t n) {
    const auto j = static_cast<Eigen::Index>(n);
    is_missed[n] = Found(answer, j) &&
                   !WallBeyond(answer.clearances.col(j).data(), x_.spec.walls, face) &&
                   !Ends(*sheets_[wall], answer.points.col(j), answer.conormals.col(j));
  });
  const auto missed = std::count(is_missed.begin(), is_missed.end(), 1);
  if (missed == 0) return;
  PointsOnWalls& wanted = x_.wanted_on_walls;
  const std::size_t first = wanted.points.size();
  for (std::size_t n = 0; n < is_missed.size(); ++n) {
    if (!is_missed[n]) continue;
    const auto y = answer.points.col(static_cast<Eigen::Index>(n));
    wanted.points.insert(wanted.points.end(), y.begin(), y.end());
    wanted.walls.push_back(face);
  }
  const Eigen::Map<const Eigen::VectorXd> y(wanted.points.data() + first, x_.mesh.d);
  x_.findings.Refuse(
      Findings::kCoverage,
      Message("the manifold ends at ", NamePoint(y), ", on wall ", wall,
              ", and the mesh does not: ",
              sheets_[wall]->radii.empty() ? "no vertex is on that wall"
                                           : "no simplex of that wall is there and faces that way",
              "; answers like it: ", missed,
              "; take epsilon at most a fifth of the width of that hole or piece"));
}

}  // namespace stellate::core
