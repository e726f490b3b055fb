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
// Queries where clearances dip, of all walls together and of each at least.
constexpr std::size_t kMostDips = 64;
constexpr std::size_t kLeastDips = 8;

// Returns at most `most` of them, evenly spread.
std::vector<std::uint32_t> Thinned(const std::vector<std::uint32_t>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<std::uint32_t> some(most);
  for (std::size_t n = 0; n < most; ++n) some[n] = all[n * all.size() / most];
  return some;
}

}  // namespace

SheetClaims::SheetClaims(Examination& examination, BoundaryClaims& boundary, EndsOfManifold& ends,
                         const ClearPoints& clear)
    : x_(examination), boundary_(boundary), ends_(ends), clear_(clear) {
  for (int wall = 0; wall < x_.spec.walls; ++wall) {
    sheets_.push_back(SheetOf(wall));
    dips_.emplace_back(clear_, static_cast<std::size_t>(x_.spec.walls),
                       static_cast<std::size_t>(wall), *sheets_.back(), x_.size);
  }
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

std::unique_ptr<Sheet> SheetClaims::SheetOf(int wall) const {
  auto sheet = std::make_unique<Sheet>(x_.mesh);
  const auto width = static_cast<std::size_t>(x_.mesh.k);
  for (const FaceMesh& face : *x_.mesh.faces) {
    if (face.walls != SetOfWall(wall)) continue;
    for (std::size_t s = 0; s < face.simplices.size(); s += width) {
      CheckInterruption(s);
      sheet->Add(face.simplices.data() + s, face.sides);
    }
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
  for (std::uint32_t f = 0; !faces_are_known && f < sheet->radii.size(); ++f) {
    CheckInterruption(f);
    const Eigen::VectorXd outward = OutwardAt(sheet->Ids(f), sheet->sides[f]);
    sheet->outward.insert(sheet->outward.end(), outward.begin(), outward.end());
  }
  sheet->Index();
  return sheet;
}

// Chooses the barycentres to query from, the farthest from the sheet first: a ball up to the sheet
// is empty, or the answer shows the contrary, so that barycentres in it need no query. How far one
// is, is only bounded until its turn comes: most are in a ball by then.
std::vector<std::uint32_t> SheetClaims::Spread(const Sheet& sheet,
                                               const Eigen::MatrixXd& barycentres,
                                               const std::vector<double>& radii) const {
  std::vector<std::uint32_t> order(radii.size());
  std::iota(order.begin(), order.end(), 0u);
  if (x_.thorough()) return order;
  if (sheet.is_empty()) return Thinned(order, kMostOfInactive);
  struct Turn {
    double far;  // at most
    bool is_exact;
    std::uint32_t n;
    bool operator<(const Turn& other) const {  // the least comes last
      if (far != other.far) return far < other.far;
      return is_exact != other.is_exact ? is_exact : n > other.n;
    }
  };
  const auto at = [&](std::uint32_t n) { return barycentres.col(n).data(); };
  std::vector<Turn> turns(radii.size());
  ParallelFor(radii.size(), [&](std::size_t i) {
    const auto n = static_cast<std::uint32_t>(i);
    turns[i] = {std::sqrt(sheet.SquaredDistanceFrom(sheet.SomeNear(at(n)), at(n))), false, n};
  });
  std::make_heap(turns.begin(), turns.end());
  std::vector<Turn> balls;
  std::vector<std::uint32_t> asked;
  for (std::size_t step = 0; !turns.empty(); ++step) {
    CheckInterruption(step);
    std::pop_heap(turns.begin(), turns.end());
    Turn& turn = turns.back();
    const bool is_in_ball = std::any_of(balls.begin(), balls.end(), [&](const Turn& ball) {
      return Distance(at(ball.n), at(turn.n), x_.mesh.d) + radii[turn.n] <= ball.far;
    });
    if (!is_in_ball && !turn.is_exact) {
      turn = {sheet.DistanceFrom(at(turn.n)), true, turn.n};
      std::push_heap(turns.begin(), turns.end());
      continue;
    }
    if (!is_in_ball) asked.push_back(turn.n);
    if (!is_in_ball && turn.far > 0) balls.push_back(turn);
    turns.pop_back();
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

std::vector<QueryBlock> SheetClaims::QuestionsWhereClearancesDip() {
  const std::size_t count = clear_.points.size() / static_cast<std::size_t>(x_.mesh.d);
  std::vector<QueryBlock> blocks(sheets_.size());
  if (looked_at_ == count) return blocks;
  BallTree tree(x_.mesh.d, &clear_.points);
  tree.Assign(std::vector<double>(count));
  const Eigen::Map<const Eigen::MatrixXd> points(clear_.points.data(), x_.mesh.d,
                                                 static_cast<Eigen::Index>(count));
  for (std::size_t wall = 0; wall < sheets_.size(); ++wall) {
    if (sheets_[wall]->is_empty()) continue;
    const std::vector<std::uint32_t> dips =
        dips_[wall].Find(tree, std::max(kLeastDips, kMostDips / sheets_.size()));
    blocks[wall] = QuestionsOf(wall, points(Eigen::all, dips));
  }
  looked_at_ = count;
  return blocks;
}

// Returns the nearest of the wall's simplices that are near enough to end the mesh there and face
// as the wall does.
std::optional<std::uint32_t> SheetClaims::NearestThatEnds(const Sheet& sheet,
                                                          const End& end) const {
  const auto d = static_cast<std::size_t>(x_.mesh.d);
  std::vector<std::uint32_t> near;
  sheet.tree.Gather(end.y, x_.DistanceAllowed(sheet.largest_radius) + x_.position_error, &near);
  std::optional<std::uint32_t> nearest;
  double least = INFINITY;
  for (const std::uint32_t f : near) {
    const double bound = x_.DistanceAllowed(sheet.radii[f]) + x_.position_error;
    if (sheet.sides[f] != end.sides) continue;
    if (Dot(sheet.outward.data() + f * d, end.conormal, x_.mesh.d) < 0) continue;
    const double squared = sheet.SquaredDistanceFrom(f, end.y);
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
      boundary_.TakePoint(static_cast<int>(wall), sheet.Ids(*nearest[n]), ends[n].y);
      continue;
    }
    if (x_.IsTouched(ends[n].y, static_cast<int>(wall))) continue;
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
              sheet.is_empty() ? "no vertex is on that wall"
                               : "no simplex of that wall is there and faces that way",
              "; answers like it: ", missed.size(),
              "; take epsilon at most a fifth of the width of that hole or piece"));
}

}  // namespace stellate::core
