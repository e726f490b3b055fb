#include "core/run/ending.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/base/first_ids.h"
#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/boundary/sharp_edges.h"
#include "core/boundary/wall_bends.h"
#include "core/certificate/evidence/evidence.h"
#include "core/certificate/findings.h"
#include "core/complex/consistency.h"
#include "core/geometry/corner_cone.h"
#include "core/geometry/reach_bound.h"
#include "core/list_walls.h"
#include "core/refinement/face_splits.h"

namespace stellate::core {
namespace {

// In epsilon: larger errors of answers are found (RepeatCheck). Points of a run that does not end
// may lie so near each other that this error dominates the curvature that they show.
constexpr double kLikelyError = 1e-3;
// In epsilon: corners of a solid this near each other, or nearer, were seen to keep runs from
// ending.
constexpr double kNearlyMeet = 0.25;
// In the reach seen: of a run that has not ended by then, M may have none there.
constexpr double kMayHaveNone = 20;
// In radii of a wall's curvature: no mesh with such an epsilon is certified, or likely to end.
constexpr double kMuchTooCoarse = 2;
// The least cosine, that of 37 degrees, of the angle from a wall's normal at which a step is taken
// to go across a layer and not along it.
constexpr double kAcross = 0.8;

// Puts a cause, its place and what to do first, before what was seen of it: "Not certified: CAUSE.
// The run ended as ...".
void Lead(const std::string& cause, std::string* verdict) {
  const std::size_t mark = verdict->find(": ");
  const std::size_t at = mark == std::string::npos ? 0 : mark + 2;
  if (at < verdict->size() && (*verdict)[at] >= 'a' && (*verdict)[at] <= 'z')
    (*verdict)[at] = static_cast<char>((*verdict)[at] - 'a' + 'A');
  verdict->insert(at, cause + ". ");
  if (!verdict->ends_with('.')) *verdict += '.';
}

}  // namespace

// The reach comes from neighbours alone: |q - p|^2 / (2 dist(q, T_pM)).
template <int K>
void DescribeUnfinished(const Engine<K>& engine, double epsilon, bool is_smooth,
                        Certificate* certificate) {
  const Stars<K>& stars = engine.stars();
  if (engine.boundary().policy().LeavesInside()) {  // no star is closed
    certificate->inconsistent_simplices = engine.violations().inconsistent();
    return;
  }
  const std::uint32_t count = std::min(stars.size(), engine.violations().star_count());
  double reach = std::numeric_limits<double>::infinity();
  std::uint32_t narrowest = 0;
  for (std::uint32_t p = 0; p < count; ++p) {
    CheckInterruption(p);
    const auto& cell = stars.cell(p);
    if (!cell.bounded()) continue;
    const std::uint64_t inconsistent = CountInconsistent<K>(stars, p);
    certificate->inconsistent_simplices += inconsistent;
    if (inconsistent > 0)
      AppendFirst({p}, Violations::kMost, &certificate->violations.inconsistent);
    certificate->max_circumradius =
        std::max(certificate->max_circumradius, std::sqrt(cell.max_norm2()));
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      double along[K];
      const double distance2 = 2 * stars.HalfSpace(p, f, along) -
                               stars.sample().ProtectingRadius2(p) +
                               stars.sample().ProtectingRadius2(cell.id(f));
      double along2 = 0;
      for (const double a : along) along2 += a * a;
      const double away = std::sqrt(std::max(distance2 - along2, 0.0));
      if (!IsTelling(std::sqrt(distance2), away, epsilon, kLikelyError * epsilon) ||
          ReachBound(distance2, away) >= reach)
        continue;
      reach = ReachBound(distance2, away);
      narrowest = p;
    }
  }
  if (std::isinf(reach)) {
    certificate->warnings.push_back(
        Message("no star could be closed: epsilon ", Brief(epsilon),
                " may be far too coarse for the manifold, or the manifold not closed or not ", K,
                "-dimensional."));
    return;
  }
  certificate->estimated_reach = reach;
  certificate->epsilon_over_reach = epsilon / reach;
  if (epsilon > kCoarse * reach && is_smooth)
    certificate->warnings.push_back(
        TooCoarse(epsilon / reach, reach,
                  Message("near vertex ", narrowest, " at ",
                          NamePoint(Eigen::Map<const Eigen::VectorXd>(
                              stars.sample().Point(narrowest), stars.sample().d())))) +
        (epsilon > kMayHaveNone * reach
             ? Message(". If finer meshes find ever less reach near there, no epsilon will do: the "
                       "manifold has a cusp or touches itself, which a ball around that place, cut "
                       "out of it by a wall, takes away, or its points are noisy, or it is not ",
                       K, "-dimensional.")
             : "."));
}

std::string DescribeCrease(const Crease& crease) {
  const double degrees = std::asin(std::min(crease.sine, 1.0)) * 180 / std::numbers::pi;
  const std::string turns =
      Message(NamePoint(crease.point), ": its tangent spaces there differ by ", Brief(degrees),
              " degrees between points that are ", Brief(crease.length), " apart");
  if (crease.crosses)
    return Message("the manifold crosses itself or is singular near ", turns,
                   ", and it goes on to all sides; no epsilon will do. Change it so that nothing "
                   "crosses there, or cut a ball around that point out of it by a wall");
  return Message(
      "the manifold has a crease or a tip near ", turns,
      "; no epsilon will do. Round it off, or declare its smooth pieces, which then meet in edges: "
      "where a function is the largest of several (max), these are walls of a solid or "
      "inequalities; where it is the least (min), those of the outside, cut off by a box. A tip, "
      "as "
      "a cone has, is cut away by a wall: g >= 0 outside of a ball around it");
}

std::string DescribeOtherDimension(const OtherDimension& other, int k) {
  return Message("the manifold has dimension ", other.dimension,
                 other.is_at_least ? " at least" : "", " near ", NamePoint(other.point),
                 " and at all of ", other.places,
                 " vertices that were looked at, but it was "
                 "declared as ",
                 k, "-dimensional; no epsilon will do. Correct the dimension");
}

template <int K>
void ExplainSharpest(const Engine<K>& engine, bool is_stalled, Certificate* certificate) {
  certificate->sharpest = Sharpest<K>(engine.stars());
  const double told_below = certificate->certified ? ThinAngle(K) : SafeAngle(K);
  if (!certificate->sharpest || certificate->sharpest->degrees >= told_below) return;
  const WallAngle& sharpest = *certificate->sharpest;
  const int first = std::countr_zero(sharpest.walls);
  const int second = std::countr_zero(sharpest.walls & (sharpest.walls - 1));
  const std::string where =
      Message("alls ", first, " and ", second, " meet at ", Brief(sharpest.degrees), " degrees at ",
              NamePoint(sharpest.point));
  if (certificate->certified) {
    certificate->warnings.push_back("W" + where + ": simplices there are as thin.");
    return;
  }
  const std::string why =
      Message("w", where, ", and in dimension ", K, " the refinement may not end below ",
              SafeAngle(K), ": cut that edge off by one wall more, or take a smaller epsilon");
  if (is_stalled) return Lead(why, &certificate->verdict);
  if (certificate->verdict.ends_with('.')) certificate->verdict.pop_back();
  certificate->verdict += Message("; ", why, ".");
}

template <int K>
void ExplainInactiveWall(const Engine<K>& engine, int walls, Certificate* certificate) {
  const Stars<K>& stars = engine.stars();
  WallSet met = 0;
  for (const std::uint32_t p : stars.sample().boundary()) met |= stars.sample().walls(p);
  certificate->verdict += AboutInactiveWall(walls, met);
}

template <int K>
bool HasPieceTooSmall(const Engine<K>& engine, double epsilon) {
  if (LoneVertex<K>(engine.stars(), 2 * epsilon)) return true;
  if (engine.sizes().given() || engine.sizes().is_estimated()) return false;  // sizes may follow
  const std::optional<WallBend> bend = SharpestBend<K>(engine.stars(), 2 * epsilon);
  return bend && epsilon > kMuchTooCoarse * bend->radius();
}

// Describes where walls of an arrangement come so near each other that they may touch; or empty.
template <int K>
std::string WhereWallsTouch(const Engine<K>& engine) {
  const Stars<K>& stars = engine.stars();
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    const double bound = engine.sizes().BoundAt(stars, p);
    const auto worst =
        WorstSizeOrShape<K>(stars, p, bound, engine.criteria().radius_edge_bound, K - 1);
    if (!worst || !IsLeftAlone<K>(stars, *worst, bound)) continue;
    const auto simplex = stars.FaceSimplexOf(p, stars.cell(p, worst->sector), worst->vertex);
    WallSet others = 0;
    for (int i = 0; i < simplex.count; ++i)
      others |= stars.sample().walls(simplex.ids[static_cast<std::size_t>(i)]) & ~simplex.walls;
    if (!simplex.foreign || others == 0) continue;
    return Message(
        "walls ", ListWalls(simplex.walls | others), " come so near each other near ",
        NamePoint(Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(p), stars.sample().d())),
        " that they may touch there: move one of them, so that they cross at an angle or stay "
        "apart by more than a fiftieth of epsilon");
  }
  return "";
}

template <int K>
void ExplainWallCurvature(const Engine<K>& engine, double epsilon,
                          const std::optional<PieceOfWall>& piece, Certificate* certificate) {
  if (certificate->certified) return;
  const Stars<K>& stars = engine.stars();
  const double longest = 2 * epsilon;  // of a mesh of that size no edge is longer
  const std::optional<WallBend> bend = SharpestBend<K>(stars, longest);
  const bool is_sharp = bend && epsilon > kCoarse * bend->radius();
  const std::optional<std::uint32_t> lone = is_sharp ? std::nullopt : LoneVertex<K>(stars, longest);
  if (!is_sharp && !lone && !piece) return;
  if (is_sharp) {
    Lead(Message("wall ", bend->wall, " bends by ", Brief(bend->degrees),
                 " degrees between vertices that are ", Brief(bend->length), " apart, near ",
                 NamePoint(bend->point), ": if it is round, take epsilon at most ",
                 Brief(bend->size_to_take()),
                 engine.criteria().graded() ? "" : ", or be as fine there alone, by a size_rate",
                 "; if it has a crease there, give its sides as walls of their own, which meet in "
                 "an edge"),
         &certificate->verdict);
    return;
  }
  // Near such a place pieces of walls are small by themselves.
  if (!WhereWallsTouch<K>(engine).empty()) return;
  const PieceOfWall small = lone ? PieceOfWall{std::countr_zero(stars.sample().walls(*lone)),
                                               Eigen::Map<const Eigen::VectorXd>(
                                                   stars.sample().Point(*lone), stars.sample().d())}
                                 : *piece;
  Lead(Message("wall ", small.wall, " has a piece at ", NamePoint(small.point),
               " that is too small for epsilon ", Brief(epsilon), ", where ",
               lone ? Message("vertex ", *lone, " finds no neighbour on it") : "no mesh ends",
               ": take epsilon at most a fifth of the width of that hole or piece"),
       &certificate->verdict);
}

// Returns the cosine of the angle between a wall's conormal at one of its vertices and a step, 0 if
// they are orthogonal.
template <int K>
double Across(const Stars<K>& stars, std::uint32_t p, int wall, const Eigen::VectorXd& step) {
  const double* const conormal =
      stars.sample().Conormals(p) + K * CountWalls(stars.sample().walls(p) & (SetOfWall(wall) - 1));
  const Eigen::Map<const Eigen::MatrixXd> tangents(stars.sample().Tangent(p), stars.sample().d(),
                                                   K);
  const Eigen::Map<const Eigen::Matrix<double, K, 1>> along(conormal);
  return std::abs(step.dot(tangents * along)) / step.norm();
}

// Returns the two walls of a thin layer that two corners are on either side of: each corner is on
// one of them, both on all others, and the step from one to the other is across these.
template <int K>
std::optional<std::pair<int, int>> LayerBetween(const Stars<K>& stars, const NearCorners& near) {
  const WallSet first = stars.sample().walls(near.first),
                second = stars.sample().walls(near.second);
  const WallSet one = first & ~second, other = second & ~first;
  if (CountWalls(one) != 1 || CountWalls(other) != 1) return std::nullopt;
  const std::pair<int, int> walls(std::countr_zero(one), std::countr_zero(other));
  using Point = Eigen::Map<const Eigen::VectorXd>;
  const Eigen::VectorXd step = Point(stars.sample().Point(near.second), stars.sample().d()) -
                               Point(stars.sample().Point(near.first), stars.sample().d());
  const bool is_layer = near.distance > 0 &&
                        Across<K>(stars, near.first, walls.first, step) >= kAcross &&
                        Across<K>(stars, near.second, walls.second, step) >= kAcross;
  return is_layer ? std::optional(walls) : std::nullopt;
}

template <int K>
void ExplainNearCorners(const Engine<K>& engine, double epsilon, Certificate* certificate) {
  if (certificate->certified) return;
  const Stars<K>& stars = engine.stars();
  const std::optional<NearCorners> near = NearestCorners<K>(stars);
  if (!near || near->distance > kNearlyMeet * epsilon) return;
  if (const auto walls = LayerBetween<K>(stars, *near)) {
    const auto [lower, upper] = std::minmax({walls->first, walls->second});
    Lead(Message("walls ", lower, " and ", upper, " are ", Brief(near->distance), " apart at ",
                 NamePoint(Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(near->first),
                                                             stars.sample().d())),
                 ", far less than epsilon ", Brief(epsilon),
                 ": leave out the layer between them, or make it thicker, or take epsilon at most ",
                 Brief(near->distance / kNearlyMeet)),
         &certificate->verdict);
    return;
  }
  Lead(
      Message("walls ",
              ListWalls(stars.sample().walls(near->first) | stars.sample().walls(near->second)),
              " nearly meet in one point: two corners are ", Brief(near->distance), " apart at ",
              NamePoint(Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(near->first),
                                                          stars.sample().d())),
              ", far less than epsilon ", Brief(epsilon),
              "; move one of these walls, so that it passes farther away, or take epsilon at most ",
              Brief(near->distance / kNearlyMeet)),
      &certificate->verdict);
}

std::string WhyTooCrowded(const CrowdedCorner& corner, int k) {
  const WallSet walls = corner.walls;
  std::string why =
      Message("walls ", ListWalls(walls), " meet in one point at ", NamePoint(corner.point));
  if (corner.beside != 0)
    return why + Message(", or nearly so: of walls ", ListWalls(corner.beside),
                         " each passes beside it, nearer than a thousandth of epsilon; move them, "
                         "so that they pass through it, or farther away from it");
  why += ", where ";
  if (corner.is_impossible)
    return why +
           "some direction has signs of theirs that the labels call impossible: correct the "
           "labels, or the walls";
  if (corner.along != 0)
    why += Message("more than ", k - 1, " of them meet along one edge of the manifold (walls ",
                   ListWalls(corner.along), "), or touch it");
  else if (CountWalls(walls) > kMostAtCorner)
    why += Message("at most ", kMostAtCorner, " can be distinguished");
  else
    why += "they leave nothing of the manifold but a part without an inside";
  return why + ": move one of them, so that it passes beside that, or cuts it at an angle";
}

// Describes the stars of faces that were left before the rest was meshed.
template <int K>
std::string AboutLeftFaces(const Engine<K>& engine) {
  const Stars<K>& stars = engine.stars();
  const int most = engine.boundary().left();
  std::uint64_t bad = 0;
  std::uint32_t first = 0;
  if (most == 0) return "";
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    const double bound = engine.sizes().BoundAt(stars, p);
    if (!WorstSizeOrShape<K>(stars, p, bound, engine.criteria().radius_edge_bound, most) &&
        !WorstSliverOrInconsistent<K>(stars, p, engine.criteria().shape, bound, most))
      continue;
    if (bad++ == 0) first = p;
  }
  if (bad == 0) return "";
  return Message(
      most == 1 ? "edges" : "faces of the boundary", " could not be fixed at ", bad,
      " vertices, the first at ",
      NamePoint(Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(first), stars.sample().d())),
      ", and the rest was meshed without them; ");
}

template <int K>
std::string WhatIsLeft(const Engine<K>& engine, std::uint64_t inconsistent) {
  if (std::string touching = WhereWallsTouch<K>(engine); !touching.empty()) return touching;
  const Stars<K>& stars = engine.stars();
  const auto& entries = engine.violations().size_and_shape();
  const auto place = [&](std::uint32_t v) {
    const WallSet walls = stars.sample().walls(v);
    return NamePoint(
               Eigen::Map<const Eigen::VectorXd>(stars.sample().Point(v), stars.sample().d())) +
           (walls == 0
                ? ""
                : (CountWalls(walls) == 1 ? ", on wall " : ", on walls ") + ListWalls(walls));
  };
  std::string left = AboutLeftFaces<K>(engine);
  if (!entries.empty())
    left += Message(entries.size(), " stars break rule R1 or R2, one of them that of vertex ",
                    entries.front().star, " near ", place(entries.front().star), "; ");
  if (!entries.empty() && inconsistent == 0) return left + "try a smaller epsilon";
  left += Message(inconsistent, " simplices are inconsistent");
  std::optional<std::uint32_t> on_face;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    CheckInterruption(p);
    // As rules count them: the simplices of an open star are not judged.
    if (!stars.cell(p).bounded()) continue;
    const auto found = FindInconsistentConfiguration<K>(stars, p);
    if (!found && !on_face && CountInconsistent<K>(stars, p) > 0) on_face = p;
    if (!found) continue;
    on_face.reset();
    left += Message(", the first in the star of vertex ", found->holder, " but not in that of ",
                    found->refuser);
    if (found->nearer) left += Message(", where vertex ", *found->nearer, " is nearer");
    left += Message(", near ", place(found->holder));
    break;
  }
  if (on_face)
    left += Message(", the first on a face of the star of vertex ", *on_face, " near ",
                    place(*on_face));
  return left + "; try a smaller epsilon";
}

template <int K>
void WarnOfCompromises(const Engine<K>& engine, double epsilon, Certificate* certificate) {
  if (const std::uint64_t too_fine = engine.sizes().CountTooFine(); too_fine > 0)
    certificate->warnings.push_back(Message("the sizes given ask for circumradii below ",
                                            Brief(engine.sizes().FinestBound()), " at ", too_fine,
                                            " vertices, finer than is meshed at epsilon ",
                                            Brief(epsilon), ": take epsilon smaller."));
  const FilledCavities& filled = engine.filled().cavities();
  if (engine.filled().is_handed_out())
    certificate->warnings.push_back(Message(
        "Stars disagreed about ", filled.inconsistent, " simplices in ", filled.cavities,
        " places; ", filled.filling, " simplices fill these instead, not all of them Delaunay."));
}

#define STELLATE_EACH(K)                                                                  \
  template void DescribeUnfinished<K>(const Engine<K>&, double, bool, Certificate*);      \
  template std::string WhatIsLeft<K>(const Engine<K>&, std::uint64_t);                    \
  template void ExplainSharpest<K>(const Engine<K>&, bool, Certificate*);                 \
  template void ExplainInactiveWall<K>(const Engine<K>&, int, Certificate*);              \
  template bool HasPieceTooSmall<K>(const Engine<K>&, double);                            \
  template void ExplainWallCurvature<K>(const Engine<K>&, double,                         \
                                        const std::optional<PieceOfWall>&, Certificate*); \
  template void ExplainNearCorners<K>(const Engine<K>&, double, Certificate*);            \
  template void WarnOfCompromises<K>(const Engine<K>&, double, Certificate*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
