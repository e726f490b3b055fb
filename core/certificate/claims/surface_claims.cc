#include "core/certificate/claims/surface_claims.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "core/base/interruption.h"
#include "core/base/message.h"
#include "core/base/random.h"
#include "core/certificate/claims/boundary_claims.h"
#include "core/certificate/complex/betti.h"
#include "core/certificate/complex/links.h"
#include "core/certificate/complex/parts.h"
#include "core/certificate/evidence/probes.h"
#include "core/certificate/measure/together.h"
#include "core/geometry/simplex.h"

namespace stellate::core {
namespace {

// Points beside simplices, and as many all over the box.
constexpr std::size_t kPointsBeside = 1000;
constexpr std::size_t kVerticesOfWall = 50;  // at least, that are queried again
// Of the largest coordinate: what any oracle's answer is rounded by.
constexpr double kRounding = 0x1p-50;

}  // namespace

void SurfaceClaims::TakeRows() {
  const auto k = static_cast<std::size_t>(x_.mesh.k), d = static_cast<std::size_t>(x_.mesh.d);
  for (const FaceMesh& face : *x_.mesh.faces) {
    if (face.dimension != x_.mesh.k - 1) continue;
    for (std::size_t s = 0; s < face.simplices.size() / k; ++s)
      rows_.push_back({face.simplices.data() + s * k, face.conormals.data() + s * k * d, face.walls,
                       face.signs[s], face.sides.first, face.sides.second, face.behind[s]});
  }
  std::sort(rows_.begin(), rows_.end(), [&](const Row& a, const Row& b) {
    return std::lexicographical_compare(a.ids, a.ids + k, b.ids, b.ids + k);
  });
}

bool SurfaceClaims::Judge() {
  Certificate& c = x_.certificate;
  c.inconsistent_simplices = x_.facts.inconsistent_simplices;
  c.max_circumradius = x_.facts.max_circumradius;
  TakeRows();
  BoundaryClaims(x_).ReportFaces();
  if (rows_.empty()) {
    x_.findings.Refuse(Findings::kComplex,
                       "no wall has a simplex: the manifold has no boundary that was found" +
                           AboutInactiveWall(x_.spec.walls, 0));
    return false;
  }
  const auto k = static_cast<std::size_t>(x_.mesh.k);
  std::set<int> labels;
  std::vector<std::uint32_t> all;
  for (const Row& row : rows_) {
    all.insert(all.end(), row.ids, row.ids + k);
    labels.insert({row.below, row.above});
  }
  const Shape shape = ShapeOf(x_.mesh.k - 1, all);
  c.components = shape.components;
  c.euler_characteristic = shape.euler_characteristic;
  c.orientable = c.links_decided_exactly = true;
  labels.erase(0);
  double together = 0;
  for (const int label : labels) together += JudgeRegion(label);
  x_.ReportPinched();
  JudgeComponents();
  c.volume = VolumeWithin([](const Row& row) { return row.below == 0 || row.above == 0; },
                          [](const Row& row) { return row.behind == 0; });
  if (!AreSameVolumes(together, c.volume))
    x_.findings.Refuse(Findings::kComplex,
                       Message("the surfaces of the regions enclose ", Brief(together),
                               " together, and what is outside of all leaves ", Brief(c.volume)));
  c.closed = c.bad_faces == 0;
  c.links_are_spheres = c.bad_links == 0;
  if (c.links_are_spheres && !c.links_decided_exactly)
    x_.findings.Warn(
        "Some vertex links have the homology of a sphere, but were not shown to be spheres.");
  if (!x_.facts.converged)
    x_.findings.Refuse(Findings::kConvergence,
                       "refinement ended while one of its rules still applied");
  Measure();
  return true;
}

// What is outside of a connected solid has one part that is not bounded, and the boundary of each
// of its parts is connected: so among the components of M's boundary one for each component of M
// encloses a positive volume, and those around cavities a negative one. Where components touch each
// other what they touch in is connected, too, and their volumes add up.
void SurfaceClaims::JudgeComponents() {
  if (x_.spec.components == 0 || x_.mesh.d != x_.mesh.k) return;
  Parts parts(x_.mesh.vertices);
  const auto is_end = [](const Row& row) { return row.below == 0 || row.above == 0; };
  for (const Row& row : rows_)
    for (int i = 1; is_end(row) && i < x_.mesh.k; ++i) parts.Join(row.ids[0], row.ids[i]);
  std::set<std::size_t> roots;
  for (const Row& row : rows_)
    if (is_end(row)) roots.insert(parts.Root(row.ids[0]));
  std::uint64_t components = 0;
  for (const std::size_t root : roots)
    components +=
        VolumeWithin([&](const Row& row) { return is_end(row) && parts.Root(row.ids[0]) == root; },
                     [](const Row& row) { return row.behind == 0; }) > 0;
  if (components < static_cast<std::uint64_t>(x_.spec.components))
    x_.findings.Refuse(
        Findings::kComponents,
        Message("the boundary is that of ", components,
                components == 1 ? " component" : " components", " where ", x_.spec.components,
                " were declared: give a seed on each, or a smaller epsilon if two came out as "
                "one"));
}

// Where more than two simplices meet, those of one part of the region are neighbours.
std::vector<SurfaceClaims::Neighbours> SurfaceClaims::NeighboursIn(
    const std::vector<std::uint32_t>& surface, int label) const {
  const int k = x_.mesh.k;
  struct Facet {
    Ids ids{};
    std::uint32_t row = 0;
    int omitted = 0;
  };
  std::vector<Facet> facets;
  for (const std::uint32_t r : surface)
    for (int out = 0; out < k; ++out) {
      Facet& facet = facets.emplace_back();
      facet.row = r, facet.omitted = out;
      for (int i = 0, n = 0; i < k; ++i)
        if (i != out) facet.ids[static_cast<std::size_t>(n++)] = rows_[r].ids[i];
    }
  std::sort(facets.begin(), facets.end(), [](const Facet& a, const Facet& b) {
    return std::pair(a.ids, a.row) < std::pair(b.ids, b.row);
  });
  std::vector<Neighbours> neighbours;
  const auto pair_up = [&](const Facet& a, const Facet& b) {
    neighbours.push_back({a.row, b.row, a.omitted, b.omitted});
  };
  for (std::size_t begin = 0, end = 0; begin < facets.size(); begin = end) {
    CheckInterruption(begin);
    while (end < facets.size() && facets[end].ids == facets[begin].ids) ++end;
    if (end - begin == 2) pair_up(facets[begin], facets[begin + 1]);
    if (end - begin <= 2 || !x_.mesh.table) continue;
    WallSet walls = ~WallSet{0};
    for (int i = 0; i + 1 < k; ++i)
      walls &= x_.mesh.WallsOf(facets[begin].ids[static_cast<std::size_t>(i)]);
    std::map<std::pair<WallSet, std::size_t>, std::vector<std::size_t>> parts;
    for (std::size_t f = begin; f < end; ++f) {
      const WallSet here = rows_[facets[f].row].Towards(label);
      const std::vector<WallSet> sectors = SectorsOf(*x_.mesh.table, walls, here, label);
      const auto at = std::find(sectors.begin(), sectors.end(), here);
      if (at == sectors.end()) continue;
      const std::vector<std::size_t> roots = PartsOfSectors(sectors);
      parts[{here & ~walls, roots[static_cast<std::size_t>(at - sectors.begin())]}].push_back(f);
    }
    for (const auto& [part, of] : parts)
      if (of.size() == 2) pair_up(facets[of[0]], facets[of[1]]);
  }
  return neighbours;
}

// Counts the pieces of a region's surface at a vertex, by the signs: a piece goes from a sector's
// wall to the next one around a face of codimension 2, where two walls meet, or all of a closure.
std::size_t SurfaceClaims::PiecesAt(std::uint32_t v, int label) const {
  const WallSet walls = x_.mesh.WallsOf(v);
  const LabelTable& table = *x_.mesh.table;
  std::map<std::pair<WallSet, WallSet>, std::size_t> ends;  // sector, wall
  for (const WallSet sector : SectorsAt(x_.mesh, v, label))
    ForEachWall(table.Bounds(walls, sector), [&](int i) {
      if (table.Of(sector ^ SetOfWall(i)) != label)
        ends.emplace(std::pair(sector, SetOfWall(i)), ends.size());
    });
  Parts parts(ends.size());
  for (const auto& [end, at] : ends) {
    const auto& [sector, i] = end;
    ForEachWall(table.Bounds(walls & ~i, sector), [&, sector = sector, i = i, at = at](int other) {
      // From sector to sector of the region around the face, each of which two of its walls bound.
      const WallSet face = table.Close(i | SetOfWall(other));
      std::pair<WallSet, WallSet> next(sector, SetOfWall(other));
      for (int steps = 0; steps < 2 * CountWalls(face); ++steps) {
        if (table.Of(next.first ^ next.second) != label) break;
        next.first ^= next.second;
        next.second = table.Bounds(face & ~next.second, next.first);
        if (CountWalls(next.second) != 1) return;
      }
      if (const auto found = ends.find(next); found != ends.end()) parts.Join(at, found->second);
    });
  }
  return parts.Count();
}

// Returns the rows of a region's surface, k ids each, with a copy of a vertex for each piece of the
// surface there but the first. `copied`: what the ids from mesh.vertices on stand for.
std::vector<std::uint32_t> SurfaceClaims::TakenApart(const std::vector<std::uint32_t>& surface,
                                                     int label,
                                                     const std::vector<Neighbours>& neighbours,
                                                     std::vector<std::uint32_t>* copied) {
  const auto k = static_cast<std::size_t>(x_.mesh.k);
  std::vector<std::uint32_t> ids;
  for (const std::uint32_t r : surface) ids.insert(ids.end(), rows_[r].ids, rows_[r].ids + k);
  if (!x_.mesh.table) return ids;
  // The corners of simplices, row by row; neighbours share those of their common vertices.
  Parts corners(ids.size());
  std::map<std::uint32_t, std::size_t> place_of;
  for (std::size_t n = 0; n < surface.size(); ++n) place_of[surface[n]] = n;
  for (const Neighbours& pair : neighbours) {
    const std::size_t a = place_of[pair.a] * k, b = place_of[pair.b] * k;
    for (std::size_t i = 0, j = 0; i < k && j < k; ++i, ++j) {
      i += i == static_cast<std::size_t>(pair.a_place);
      j += j == static_cast<std::size_t>(pair.b_place);
      if (i < k && j < k) corners.Join(a + i, b + j);
    }
  }
  std::map<std::uint32_t, std::map<std::size_t, std::uint32_t>> copies;  // by vertex, root
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const std::uint32_t v = ids[i];
    if (CountWalls(x_.mesh.WallsOf(v)) < 2) continue;
    auto& of = copies[v];
    const auto next = static_cast<std::uint32_t>(x_.mesh.vertices + copied->size());
    const auto [copy, is_new] = of.emplace(corners.Root(i), of.empty() ? v : next);
    if (is_new && copy->second != v) copied->push_back(v);
    ids[i] = copy->second;
  }
  for (const auto& [v, of] : copies)
    if (const std::size_t expected = PiecesAt(v, label); of.size() != expected)
      x_.findings.Refuse(Findings::kLinks,
                         Message("the surface of label ", label, " has ", of.size(),
                                 of.size() == 1 ? " piece" : " pieces", " at vertex ", v,
                                 " where the walls' signs leave ", expected));
  for (std::size_t s = 0; s < ids.size(); s += k)
    std::sort(ids.begin() + static_cast<std::ptrdiff_t>(s),
              ids.begin() + static_cast<std::ptrdiff_t>(s + k));
  return ids;
}

// Whether neighbours induce opposite orientations on what they share, turned out of the region.
bool SurfaceClaims::AreTurnedAlike(int label, const std::vector<Neighbours>& neighbours) const {
  return std::all_of(neighbours.begin(), neighbours.end(), [&](const Neighbours& pair) {
    const bool a = (rows_[pair.a].behind == label) != (pair.a_place % 2 == 1);
    const bool b = (rows_[pair.b].behind == label) != (pair.b_place % 2 == 1);
    return a != b;
  });
}

double SurfaceClaims::VolumeWithin(FunctionRef<bool(const Row&)> is_of_it,
                                   FunctionRef<bool(const Row&)> faces_inwards) const {
  if (x_.mesh.d != x_.mesh.k) return 0;
  std::vector<std::uint32_t> simplices;
  std::vector<bool> turned;
  for (const Row& row : rows_) {
    if (!is_of_it(row)) continue;
    simplices.insert(simplices.end(), row.ids, row.ids + x_.mesh.k);
    turned.push_back(faces_inwards(row));
  }
  return EnclosedVolume(x_.mesh, simplices, turned);
}

// Returns the volume of the region.
double SurfaceClaims::JudgeRegion(int label) {
  Certificate& c = x_.certificate;
  const int k = x_.mesh.k;
  std::vector<std::uint32_t> surface, plain;
  for (std::uint32_t r = 0; r < rows_.size(); ++r) {
    if (rows_[r].below != label && rows_[r].above != label) continue;
    surface.push_back(r);
    plain.insert(plain.end(), rows_[r].ids, rows_[r].ids + k);
  }
  const std::vector<Neighbours> neighbours = NeighboursIn(surface, label);
  std::vector<std::uint32_t> copied;
  const std::vector<std::uint32_t> ids = TakenApart(surface, label, neighbours, &copied);
  x_.pinched.insert(copied.begin(), copied.end());
  const auto vertices = static_cast<std::uint32_t>(x_.mesh.vertices + copied.size());
  const Adjacency closed(SimplexList{k - 1, vertices, &ids});
  const LinkReport links = CheckLinks(closed);
  c.bad_faces += closed.bad_facets();
  c.bad_links += links.bad_links;
  c.links_decided_exactly = c.links_decided_exactly && links.decided_exactly;
  const bool orientable =
      x_.mesh.d == k ? AreTurnedAlike(label, neighbours) : ComputeConnectivity(closed).orientable;
  c.orientable = c.orientable && orientable;
  const std::string name =
      x_.mesh.table ? Message("the surface of label ", label) : std::string("the boundary");
  if (closed.bad_facets() > 0)
    x_.findings.Refuse(
        Findings::kComplex,
        Message(name, " is not closed: ", closed.first_bad_facet(),
                ", where each must be in two; faces like it: ", closed.bad_facets()));
  if (links.bad_links > 0)
    x_.findings.Refuse(Findings::kLinks, Message("in ", name, " ", links.first_bad_link,
                                                 "; vertices like it: ", links.bad_links));
  if (x_.mesh.d == k && !orientable && closed.bad_facets() == 0)
    x_.findings.Refuse(Findings::kComplex,
                       "neighbours in " + name + " do not agree about what is outside");
  const double volume =
      VolumeWithin([&](const Row& row) { return row.below == label || row.above == label; },
                   [&](const Row& row) { return row.behind != label; });
  if (!x_.mesh.table) return volume;
  const Shape shape = ShapeOf(k - 1, plain);
  RegionReport report;
  report.label = label;
  report.simplices = surface.size();
  report.components = shape.components;
  report.euler_characteristic = shape.euler_characteristic;
  report.volume = volume;
  report.min_dihedral_degrees = MeasureTogether(x_.mesh, k - 1, plain).min_dihedral_degrees;
  report.betti = BettiNumbers(k - 1, static_cast<std::int64_t>(shape.components),
                              shape.euler_characteristic, plain);
  c.regions.push_back(report);
  return volume;
}

// Returns the largest angle between a simplex and the tangent space of its wall at one
// of its vertices: the part of T_pM orthogonal to the conormal.
double SurfaceClaims::TiltAt(const Row& row, int place) const {
  const int k = x_.mesh.k, d = x_.mesh.d;
  const Eigen::Map<const Eigen::VectorXd> conormal(row.conormals + place * d, d);
  const Eigen::MatrixXd tangents = x_.Tangents(row.ids[place]);
  // The reflection that takes the last axis to the conormal takes the others to its complement.
  Eigen::VectorXd mirror = tangents.transpose() * conormal;
  const double norm = mirror.norm();
  if (norm == 0) return std::numbers::pi / 2;
  mirror /= norm;
  mirror[k - 1] += mirror[k - 1] >= 0 ? 1 : -1;
  const Eigen::MatrixXd reflected =
      tangents - (tangents * mirror) * mirror.transpose() * (2 / mirror.squaredNorm());
  const double* corners[kMaxDimension];
  for (int i = 0; i < k; ++i) corners[i] = x_.mesh.Point(row.ids[i]);
  const SimplexVertices vertices{corners, static_cast<std::size_t>(k)};
  return AngleToTangent(vertices, d, reflected.data(), k - 1);
}

void SurfaceClaims::Measure() {
  Certificate& c = x_.certificate;
  const int k = x_.mesh.k;
  x_.longest_edge.assign(x_.mesh.vertices, 0);
  double largest = 0, smallest_angle = 10, tilt = 0;
  c.min_fatness = 1;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    CheckInterruption(r);
    const Row& row = rows_[r];
    const double* corners[kMaxDimension];
    bool has_ball = false;
    for (int i = 0; i < k; ++i) {
      corners[i] = x_.mesh.Point(row.ids[i]);
      has_ball = has_ball || x_.mesh.ProtectingRadius2(row.ids[i]) > 0;
      tilt = std::max(tilt, TiltAt(row, i));
      for (int j = 0; j < k; ++j) {
        double& longest = x_.longest_edge[row.ids[i]];
        longest = std::max(longest, (x_.Vertex(row.ids[j]) - x_.Vertex(row.ids[i])).norm());
      }
    }
    const SimplexVertices vertices{corners, static_cast<std::size_t>(k)};
    const SimplexMeasures measures = MeasureSimplex(vertices, x_.mesh.d);
    c.min_fatness = std::min(c.min_fatness, measures.Fatness());
    if (k == 3)
      smallest_angle = std::min(smallest_angle, SmallestTriangleAngle(vertices, x_.mesh.d));
    if (has_ball) continue;  // R1 bounds its orthoradius, R2 nothing
    c.max_radius_edge = std::max(c.max_radius_edge, measures.RadiusEdgeRatio());
    largest = std::max(largest, measures.circumradius);
  }
  if (k == 3) c.min_angle_degrees = smallest_angle * 180 / std::numbers::pi;
  c.max_tangent_angle_degrees = tilt * 180 / std::numbers::pi;
  c.max_circumradius = std::max(c.max_circumradius, largest);
  if (!(c.max_circumradius <= x_.spec.epsilon * (1 + kSizeTolerance)))
    x_.findings.Refuse(Findings::kSize, Message("a simplex of the boundary has the circumradius ",
                                                Brief(c.max_circumradius),
                                                ", more than epsilon = ", Brief(x_.spec.epsilon)));
  x_.size = std::min(c.max_circumradius, x_.spec.epsilon);
  const MeshBox box = BoxOf(x_.mesh);
  x_.position_error =
      kRounding * std::max(box.lower.cwiseAbs().maxCoeff(), box.upper.cwiseAbs().maxCoeff());
}

std::vector<QueryBlock> SurfaceClaims::VertexQuestions() const {
  std::vector<QueryBlock> blocks;
  for (int wall = 0; wall < x_.spec.walls; ++wall) {
    std::vector<std::uint32_t> on;
    for (std::uint32_t v = 0; v < x_.mesh.vertices; ++v)
      if (x_.mesh.WallsOf(v) == SetOfWall(wall)) on.push_back(v);
    const std::size_t step = std::max<std::size_t>(1, on.size() / kVerticesOfWall);
    QueryBlock& block = blocks.emplace_back();
    block.face = SetOfWall(wall);
    block.want.clearances = block.want.tangents = true;
    block.points.resize(x_.mesh.d, static_cast<Eigen::Index>((on.size() + step - 1) / step));
    for (Eigen::Index n = 0; n < block.points.cols(); ++n)
      block.points.col(n) = x_.Vertex(on[static_cast<std::size_t>(n) * step]);
  }
  return blocks;
}

void SurfaceClaims::JudgeVertices(const Eigen::MatrixXd& asked, const AnswerBlock& answer) {
  for (Eigen::Index j = 0; j < asked.cols(); ++j)
    if (Found(answer, j))
      x_.position_error = std::max(x_.position_error, (answer.points.col(j) - asked.col(j)).norm());
}

Eigen::MatrixXd SurfaceClaims::PointsBeside() const {
  const Eigen::Index d = x_.mesh.d;
  const std::size_t step = std::max<std::size_t>(1, 2 * rows_.size() / kPointsBeside);
  std::vector<Eigen::VectorXd> points;
  for (std::size_t r = Mix64(x_.spec.random_seed) % step; r < rows_.size(); r += step) {
    Eigen::VectorXd middle = Eigen::VectorXd::Zero(d), out = middle;
    for (int i = 0; i < x_.mesh.k; ++i) {
      middle += x_.Vertex(rows_[r].ids[i]) / static_cast<double>(x_.mesh.k);
      out += Eigen::Map<const Eigen::VectorXd>(rows_[r].conormals + i * d, d);
    }
    if (!(out.norm() > 0)) continue;
    points.push_back(middle + x_.size * out.normalized());
    points.push_back(middle - x_.size * out.normalized());
  }
  const MeshBox box = BoxOf(x_.mesh);
  Random random(x_.spec.random_seed, 1);
  for (std::size_t n = 0; n < kPointsBeside; ++n) {
    Eigen::VectorXd& point = points.emplace_back(box.lower);
    for (Eigen::Index i = 0; i < d; ++i)
      point[i] += random.Uniform() * (box.upper[i] - box.lower[i]);
  }
  Eigen::MatrixXd all(d, static_cast<Eigen::Index>(points.size()));
  for (std::size_t n = 0; n < points.size(); ++n) all.col(static_cast<Eigen::Index>(n)) = points[n];
  return all;
}

}  // namespace stellate::core
