#include "core/certificate/claims/sheet_claims.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "core/base/dense.h"
#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/evidence/probes.h"
#include "core/certificate/measure/small_solve.h"
#include "core/wall_beyond.h"

namespace stellate::core {
namespace {

// Queries of all walls together, and of each wall at least; of an inactive wall, for which any
// answer is news.
constexpr std::size_t kMostQuestions = kMaxBarycentres;
constexpr std::size_t kLeastOfWall = 250;
constexpr std::size_t kMostOfInactive = 100;
// Queries where clearances dip, of all walls together and of each at least. A clearance is a dip if
// it is this share, or less, of what so many points near it predict.
constexpr std::size_t kMostDips = 64;
constexpr std::size_t kLeastDips = 8;
constexpr double kDip = 0.85;
constexpr std::size_t kPointsNear = 8;
constexpr std::size_t kCandidatesNear = 6 * kPointsNear;  // most lie where others lie
constexpr double kApart = 0.25;  // of the mesh size: what is nearer is in the same dip
// In mesh sizes: so near to a wall the distance from the wall's mesh is a poor estimate of that
// from the wall.
constexpr double kBeside = 0.15;
constexpr double kLessRounding = 1 - 0x1p-40;  // some thousand roundings of a squared distance
constexpr double kAfar = 4;                    // of the largest radius of the mesh's simplices

// Returns the squared distance of y from a simplex: from the nearest of the faces above or below
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

// Returns at most `most` of them, evenly spread.
std::vector<std::uint32_t> Thinned(const std::vector<std::uint32_t>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<std::uint32_t> some(most);
  for (std::size_t n = 0; n < most; ++n) some[n] = all[n * all.size() / most];
  return some;
}

// Returns the clear points nearest to q that are no nearer to it, or to each other, than `apart`,
// nearest first. A place that was queried often must not outvote the rest.
std::vector<std::uint32_t> NearestApart(const BallTree& tree, const std::vector<double>& points,
                                        const std::vector<double>& shares, const double* q, int d,
                                        double apart) {
  std::vector<std::pair<double, std::uint32_t>> nearest;
  tree.VisitNear(
      q,
      [&] {
        return nearest.size() < kCandidatesNear ? double{INFINITY}
                                                : std::sqrt(nearest.back().first);
      },
      [&](std::uint32_t other, double squared) {
        if (squared < apart * apart || shares[other] == 0) return;
        const std::pair<double, std::uint32_t> entry{squared, other};
        nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), entry), entry);
        if (nearest.size() > kCandidatesNear) nearest.pop_back();
      });
  std::vector<std::uint32_t> ids;
  const auto point = [&](std::uint32_t n) {
    return points.data() + static_cast<std::size_t>(n) * static_cast<std::size_t>(d);
  };
  for (const auto& entry : nearest) {
    if (ids.size() == kPointsNear) break;
    const std::uint32_t other = entry.second;
    const bool is_apart = std::none_of(ids.begin(), ids.end(), [&](std::uint32_t taken) {
      return SquaredDistance(point(taken), point(other), d) < apart * apart;
    });
    if (is_apart) ids.push_back(other);
  }
  return ids;
}

}  // namespace

SheetClaims::SheetClaims(Examination& examination, BoundaryClaims& boundary, EndsOfManifold& ends,
                         const ClearPoints& clear)
    : x_(examination), boundary_(boundary), ends_(ends), clear_(clear) {
  for (int wall = 0; wall < x_.spec.walls; ++wall) sheets_.push_back(SheetOf(wall));
}

// Returns the direction from the apex of the simplex that ends at a facet straight to that facet,
// or, if that simplex is on the wall's negative side, back.
Eigen::VectorXd SheetClaims::OutwardAt(const std::uint32_t* facet,
                                       std::pair<int, int> sides) const {
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
    const bool is_behind = x_.mesh.labels && x_.mesh.labels[s] != sides.second;
    return is_behind ? Eigen::VectorXd(-out) : out;
  }
  return Eigen::VectorXd::Zero(x_.mesh.d);  // none ends there, which is refused: no direction
}

std::unique_ptr<SheetClaims::Sheet> SheetClaims::SheetOf(int wall) const {
  auto sheet = std::make_unique<Sheet>(x_.mesh.d);
  const auto width = static_cast<std::size_t>(x_.mesh.k);
  for (const FaceMesh& face : *x_.mesh.faces) {
    if (face.walls != SetOfWall(wall)) continue;
    sheet->simplices.insert(sheet->simplices.end(), face.simplices.begin(), face.simplices.end());
    sheet->sides.resize(sheet->simplices.size() / width, face.sides);
    // Where the inside is not meshed the wall's own conormals tell how it faces.
    const Eigen::Map<const Eigen::MatrixXd> conormals(
        face.conormals.data(), x_.mesh.d,
        static_cast<Eigen::Index>(face.conormals.size()) / x_.mesh.d);
    for (Eigen::Index s = 0; s < conormals.cols(); s += x_.mesh.k) {
      const Eigen::VectorXd sum = conormals.middleCols(s, x_.mesh.k).rowwise().sum();
      sheet->outward.insert(sheet->outward.end(), sum.begin(), sum.end());
    }
  }
  const bool faces_are_known = !sheet->outward.empty();
  for (std::size_t s = 0; s < sheet->simplices.size(); s += width) {
    CheckInterruption(s);
    const std::uint32_t* ids = sheet->simplices.data() + s;
    Eigen::VectorXd barycentre = Eigen::VectorXd::Zero(x_.mesh.d);
    for (std::size_t i = 0; i < width; ++i) barycentre += x_.Vertex(ids[i]);
    barycentre /= static_cast<double>(width);
    double radius = 0;
    for (std::size_t i = 0; i < width; ++i)
      radius = std::max(radius, (x_.Vertex(ids[i]) - barycentre).norm());
    AppendDirections(x_.mesh, ids, static_cast<int>(width), &sheet->directions);
    sheet->barycentres.insert(sheet->barycentres.end(), barycentre.begin(), barycentre.end());
    if (!faces_are_known) {
      const Eigen::VectorXd outward = OutwardAt(ids, sheet->sides[s / width]);
      sheet->outward.insert(sheet->outward.end(), outward.begin(), outward.end());
    }
    sheet->radii.push_back(radius);
    sheet->largest_radius = std::max(sheet->largest_radius, radius);
  }
  sheet->tree.Assign(sheet->radii);
  return sheet;
}

// Chooses the barycentres to query from, the farthest from the sheet first: a ball up to the sheet
// is empty, or the answer shows the contrary, so that barycentres in it need no query.
std::vector<std::uint32_t> SheetClaims::Spread(const Sheet& sheet,
                                               const Eigen::MatrixXd& barycentres,
                                               const std::vector<double>& radii) const {
  std::vector<std::uint32_t> order(radii.size());
  std::iota(order.begin(), order.end(), 0u);
  if (x_.thorough()) return order;
  if (sheet.radii.empty()) return Thinned(order, kMostOfInactive);
  std::vector<double> far(radii.size());
  ParallelFor(radii.size(), [&](std::size_t n) {
    const double* at = barycentres.col(static_cast<Eigen::Index>(n)).data();
    far[n] = DistanceFrom(sheet, at);
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
  std::vector<QueryBlock> blocks;
  for (std::size_t wall = 0; wall < sheets_.size(); ++wall)
    blocks.push_back(
        QuestionsOf(wall, barycentres(Eigen::all, Spread(*sheets_[wall], barycentres, radii))));
  return blocks;
}

std::vector<QueryBlock> SheetClaims::QuestionsFrom(const Eigen::MatrixXd& points) const {
  std::vector<std::uint32_t> all(static_cast<std::size_t>(points.cols()));
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<std::uint32_t> some =
      Thinned(all, std::max(kLeastOfWall, kMostQuestions / sheets_.size()));
  std::vector<QueryBlock> blocks;
  for (std::size_t wall = 0; wall < sheets_.size(); ++wall)
    blocks.push_back(QuestionsOf(wall, points(Eigen::all, some)));
  return blocks;
}

QueryBlock SheetClaims::QuestionsOf(std::size_t wall, Eigen::MatrixXd points) const {
  QueryBlock block;
  block.face = SetOfWall(static_cast<int>(wall));
  block.want.clearances = block.want.tangents = true;
  block.points = std::move(points);
  return block;
}

// Returns a lower bound of the squared distance from a simplex of the wall's mesh, of which y is
// `squared` from the barycentre: the simplex lies in a disc around that, in its own flat. So a
// large plane side is searched at the foot of y and not over all that is about as far.
double SheetClaims::SquaredBoundFrom(const Sheet& sheet, std::uint32_t f, const double* y,
                                     double squared) const {
  const int d = x_.mesh.d, along = x_.mesh.k - 1;
  const double* barycentre = sheet.barycentres.data() + f * static_cast<std::size_t>(d);
  const double* direction = sheet.directions.data() + f * static_cast<std::size_t>(along * d);
  double in_flat2 = 0;
  for (int r = 0; r < along; ++r, direction += d) {
    double step = 0;
    for (int i = 0; i < d; ++i) step += direction[i] * (y[i] - barycentre[i]);
    in_flat2 += step * step;
  }
  const double beyond = std::max(0.0, std::sqrt(in_flat2) - sheet.radii[f]);
  return (squared - in_flat2 + beyond * beyond) * kLessRounding;
}

// Returns the distance from the mesh of the wall; infinity if it has none.
double SheetClaims::DistanceFrom(const Sheet& sheet, const double* y) const {
  const auto width = static_cast<std::size_t>(x_.mesh.k);
  double best = INFINITY;
  sheet.tree.VisitNear(
      y, [&] { return best + sheet.largest_radius; },
      [&](std::uint32_t f, double squared) {
        if (std::sqrt(squared) - sheet.radii[f] >= best) return;
        if (SquaredBoundFrom(sheet, f, y, squared) >= best * best) return;
        const std::uint32_t* ids = sheet.simplices.data() + f * width;
        best = std::min(best, std::sqrt(SquaredDistanceFrom(x_.mesh, ids, x_.mesh.k, y)));
      });
  return best;
}

// Computes the shares of the clear points that have none yet.
void SheetClaims::TakeShares(std::size_t wall) {
  Sheet& sheet = *sheets_[wall];
  const auto d = static_cast<std::size_t>(x_.mesh.d);
  const std::size_t first = sheet.shares.size(), count = clear_.points.size() / d;
  sheet.shares.resize(count, 0);
  ParallelFor(count - first, [&](std::size_t i) {
    const std::size_t n = first + i;
    const double clear = clear_.clearances[n * sheets_.size() + wall];
    if (clear == 0) return;
    const double* y = clear_.points.data() + n * d;
    // From afar a barycentre is about as far as its simplex.
    double far = std::sqrt(NearestSquaredDistance(sheet.tree, y));
    if (far < kAfar * sheet.largest_radius) far = DistanceFrom(sheet, y);
    if (far > kBeside * x_.size) sheet.shares[n] = clear / far;
  });
}

// Returns the dips, the deepest first. `tree`: of all clear points.
std::vector<std::uint32_t> SheetClaims::Dips(const Sheet& sheet, const BallTree& tree) const {
  const std::vector<double>& share = sheet.shares;
  const double most = kDip * *std::max_element(share.begin(), share.end());
  std::vector<double> dip(share.size(), 1.0);
  ParallelFor(share.size() - looked_at_, [&](std::size_t i) {
    const std::size_t n = looked_at_ + i;
    if (share[n] == 0 || share[n] > most) return;
    std::vector<double> near;
    const double* y = clear_.points.data() + n * static_cast<std::size_t>(x_.mesh.d);
    for (const std::uint32_t other :
         NearestApart(tree, clear_.points, share, y, x_.mesh.d, kApart * x_.size))
      near.push_back(share[other]);
    if (near.empty()) return;
    const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
    std::nth_element(near.begin(), middle, near.end());
    dip[n] = share[n] / *middle;
  });
  std::vector<std::uint32_t> dips;
  for (std::uint32_t n = 0; n < dip.size(); ++n)
    if (dip[n] <= kDip) dips.push_back(n);
  std::stable_sort(dips.begin(), dips.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return dip[a] < dip[b]; });
  dips.resize(std::min(dips.size(), std::max(kLeastDips, kMostDips / sheets_.size())));
  return dips;
}

std::vector<QueryBlock> SheetClaims::QuestionsWhereClearancesDip() {
  const std::size_t count = clear_.points.size() / static_cast<std::size_t>(x_.mesh.d);
  std::vector<QueryBlock> blocks(sheets_.size());
  if (looked_at_ == count) return blocks;
  BallTree tree(x_.mesh.d, &clear_.points);
  tree.Assign(std::vector<double>(count));
  const Eigen::Map<const Eigen::MatrixXd> points(clear_.points.data(), x_.mesh.d,
                                                 static_cast<Eigen::Index>(count));
  for (std::size_t wall = 0; wall < sheets_.size(); ++wall) {
    if (sheets_[wall]->radii.empty()) continue;
    TakeShares(wall);
    blocks[wall] = QuestionsOf(wall, points(Eigen::all, Dips(*sheets_[wall], tree)));
  }
  looked_at_ = count;
  return blocks;
}

// Returns the nearest of the wall's simplices that are near enough to end the mesh there and face
// as the wall does.
std::optional<std::uint32_t> SheetClaims::NearestThatEnds(const Sheet& sheet,
                                                          const End& end) const {
  const auto width = static_cast<std::size_t>(x_.mesh.k), d = static_cast<std::size_t>(x_.mesh.d);
  std::vector<std::uint32_t> near;
  sheet.tree.Gather(end.y, x_.DistanceAllowed(sheet.largest_radius) + x_.position_error, &near);
  std::optional<std::uint32_t> nearest;
  double least = INFINITY;
  for (const std::uint32_t f : near) {
    const double bound = x_.DistanceAllowed(sheet.radii[f]) + x_.position_error;
    if (sheet.sides[f] != end.sides) continue;
    if (Dot(sheet.outward.data() + f * d, end.conormal, x_.mesh.d) < 0) continue;
    const double squared =
        SquaredDistanceFrom(x_.mesh, sheet.simplices.data() + f * width, x_.mesh.k, end.y);
    if (squared > bound * bound || squared >= least) continue;
    least = squared;
    nearest = f;
  }
  return nearest;
}

// Returns the labels on both sides of a wall at a point of it; nothing if the wall is not live
// there.
std::optional<std::pair<int, int>> SheetClaims::SidesOf(int wall, const double* clearances) const {
  const WallSet face = SetOfWall(wall);
  if (!x_.mesh.table)
    return WallBeyond(clearances, x_.spec.walls, face) ? std::nullopt
                                                       : std::optional(std::pair(0, 1));
  const auto sides = x_.mesh.table->Sides(face, SignsOf(clearances, x_.spec.walls));
  const bool is_live =
      sides.first != sides.second && std::min(sides.first, sides.second) != LabelTable::kImpossible;
  return is_live ? std::optional(sides) : std::nullopt;
}

void SheetClaims::Judge(std::size_t wall, const Eigen::MatrixXd&, const AnswerBlock& answer) {
  std::vector<End> ends;
  for (Eigen::Index j = 0; j < answer.points.cols(); ++j) {
    const double *y = answer.points.col(j).data(), *conormal = answer.conormals.col(j).data();
    if (!Found(answer, j)) continue;
    const std::optional<std::pair<int, int>> sides =
        SidesOf(static_cast<int>(wall), answer.clearances.col(j).data());
    if (!sides) continue;
    ends.push_back({y, conormal, *sides});
    ends_.Add(y, static_cast<int>(wall), conormal, x_.mesh.d, *sides);
  }
  JudgeEnds(wall, ends);
}

void SheetClaims::JudgeKnown() {
  const auto d = static_cast<std::size_t>(x_.mesh.d);
  std::vector<std::vector<End>> ends(sheets_.size());
  for (std::size_t n = 0; n < ends_.walls.size(); ++n)
    ends[static_cast<std::size_t>(ends_.walls[n])].push_back(
        {ends_.points.data() + n * d, ends_.conormals.data() + n * d, ends_.sides[n]});
  for (std::size_t wall = 0; wall < ends.size(); ++wall) JudgeEnds(wall, ends[wall]);
}

// Checks that the mesh ends at each end, facing as the wall does, and is fine enough for it.
void SheetClaims::JudgeEnds(std::size_t wall, const std::vector<End>& ends) {
  const Sheet& sheet = *sheets_[wall];
  std::vector<std::optional<std::uint32_t>> nearest(ends.size());
  ParallelFor(ends.size(), [&](std::size_t n) { nearest[n] = NearestThatEnds(sheet, ends[n]); });
  PointsOnWalls& wanted = x_.wanted_on_walls;
  std::vector<const double*> missed;
  for (std::size_t n = 0; n < ends.size(); ++n) {
    CheckInterruption(n);
    if (nearest[n]) {
      const std::size_t first = *nearest[n] * static_cast<std::size_t>(x_.mesh.k);
      boundary_.TakePoint(static_cast<int>(wall), sheet.simplices.data() + first, ends[n].y);
      continue;
    }
    missed.push_back(ends[n].y);
    wanted.points.insert(wanted.points.end(), ends[n].y, ends[n].y + x_.mesh.d);
    wanted.walls.push_back(SetOfWall(static_cast<int>(wall)));
  }
  if (missed.empty()) return;
  x_.findings.Refuse(
      Findings::kCoverage,
      Message("the manifold ends at ",
              NamePoint(Eigen::Map<const Eigen::VectorXd>(missed.front(), x_.mesh.d)), ", on wall ",
              wall, ", and the mesh does not: ",
              sheet.radii.empty() ? "no vertex is on that wall"
                                  : "no simplex of that wall is there and faces that way",
              "; answers like it: ", missed.size(),
              "; take epsilon at most a fifth of the width of that hole or piece"));
}

}  // namespace stellate::core
