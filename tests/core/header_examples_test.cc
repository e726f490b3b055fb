// The examples in comments of headers, as they stand there: tests/words/examples_test.py compares
// them.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/function_ref.h"
#include "core/base/instantiate.h"
#include "core/base/message.h"
#include "core/base/name_point.h"
#include "core/base/parallel.h"
#include "core/base/parallel_copy.h"
#include "core/base/parallel_select.h"
#include "core/base/parallel_sort.h"
#include "core/base/parcel.h"
#include "core/base/vector_ops.h"
#include "core/batch.h"
#include "core/certificate/mesh_view.h"
#include "core/index/ball_tree.h"
#include "core/list_walls.h"
#include "core/mesher.h"
#include "core/parts/boxes.h"
#include "core/parts/territory.h"
#include "core/peers.h"
#include "core/places.h"
#include "core/reconstruction.h"
#include "core/report.h"
#include "core/specification.h"
#include "core/status.h"
#include "core/walls.h"

namespace stellate::core {
namespace header_examples {

using Triangles = std::set<std::array<std::uint32_t, 3>>;

Triangles TrianglesOf(const std::vector<std::uint32_t>& ids) {
  Triangles triangles;
  for (std::size_t i = 0; i < ids.size(); i += 3)
    triangles.insert({ids[i], ids[i + 1], ids[i + 2]});
  return triangles;
}

// core/base/instantiate.h
template <int K>
class Doubler {
 public:
  int Of(int n) const;
};
STELLATE_DECLARE_CLASS(Doubler)

template <int K>
int Doubler<K>::Of(int n) const {
  return 2 * n;
}
STELLATE_INSTANTIATE_CLASS(Doubler)

template <int K>
int Tripled(int n) {
  return 3 * n + 0 * K;
}
#define STELLATE_EACH(K) template int Tripled<K>(int);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

// core/base/function_ref.h
double SumOf(std::size_t count, FunctionRef<double(std::size_t)> term);
double SumOf(std::size_t count, FunctionRef<double(std::size_t)> term) {
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += term(i);
  return sum;
}

// core/status.h
Expected<int> Half(int n) {
  if (n % 2 != 0) return Refuse(StatusCode::kInvalidArgument, Message(n, " is odd"), "n");
  return n / 2;
}

// core/specification.h
Specification UnitSphere(const Eigen::MatrixXd& points_near_m) {
  Specification spec;
  spec.dimension = 2, spec.ambient_dimension = 3, spec.epsilon = 0.1;
  spec.seeds = points_near_m;          // 3 x m
  spec.criteria.max_deviation = 1e-3;  // finer where M bends
  if (const Status status = Validate(spec); !status.ok()) std::cerr << status.message << '\n';
  return spec;
}

Answers AnswersTo(const QueryBatch& batch) {
  Answers answers;
  for (const QueryBlock& block : batch.blocks) {
    AnswerBlock answer = AnswerBlock::Shape(2, 0, block, block.size());
    answer.points = block.points.colwise().normalized();
    answers.blocks.push_back(std::move(answer));
  }
  return answers;
}

// core/mesher.h
template <typename UseMesh>
Status MeshIt(const Specification& spec, const UseMesh& Use) {
  const Expected<std::unique_ptr<Mesher>> made = Mesher::Create(spec);
  if (!made) return made.error();
  Mesher& mesher = **made;
  while (const auto batch = mesher.NextBatch()) {
    const Expected<MeshDelta> delta = mesher.Absorb(AnswersTo(*batch));
    if (!delta) mesher.Fail(delta.error());
  }
  if (mesher.report().certificate.certified) Use(mesher.Points(), mesher.Simplices());
  return mesher.report().failure;
}

TEST(HeaderExamples, OfTextAndStatus) {
  EXPECT_EQ(Message("epsilon is ", 0.1, ", not > ", 1), "epsilon is 0.1, not > 1");
  EXPECT_EQ(Brief(2.0 / 3), "0.6667");
  EXPECT_EQ(NamePoint(Eigen::Vector2d(0.5, 1)), "(0.5, 1)");
  EXPECT_EQ(ListWalls(SetOfWall(0) | SetOfWall(2)), "0, 2");
  const Expected<int> half = Half(7);
  if (!half) std::cerr << StatusCodeName(half.error().code) << ": " << half.error().message;
  EXPECT_EQ(half.error().message, "7 is odd");
  EXPECT_EQ(*Half(6), 3);
  Specification spec;
  spec.dimension = 2;
  const Status status = Validate(spec);
  if (!status.ok()) std::cerr << status.field << ": " << status.message << '\n';
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(WithMeshDimension(spec.dimension, [](auto k) { return Doubler<k()>().Of(k()); }), 4);
}

TEST(HeaderExamples, OfLoops) {
  std::vector<double> values(5000), norms(5000);
  std::iota(values.begin(), values.end(), -2500.0);
  ParallelFor(norms.size(), [&](std::size_t i) { norms[i] = std::abs(values[i]); });
  EXPECT_EQ(norms.front(), 2500);
  std::vector<double> sums(ChunkCount(values.size()));
  ParallelChunks(values.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) sums[chunk] += values[i];
  });
  EXPECT_EQ(std::accumulate(sums.begin(), sums.end(), 0.0), -2500);
  const auto negative = ParallelGather<double>(values.size(), [&](std::size_t i, auto* found) {
    if (values[i] < 0) found->push_back(values[i]);
  });
  EXPECT_EQ(negative.size(), 2500u);
  EXPECT_EQ(ParallelSelect(values.size(), [&](std::size_t i) { return values[i] < 0; }).size(),
            2500u);
  EXPECT_EQ(SumOf(values.size(), [&](std::size_t i) { return values[i]; }), -2500);
  std::reverse(values.begin(), values.end());
  ParallelSort(values, std::less<>());
  EXPECT_TRUE(std::is_sorted(values.begin(), values.end()));
  ParallelCopy(values.data(), values.size(), norms.data());
  EXPECT_EQ(norms, values);
}

TEST(HeaderExamples, OfVectorsAndParts) {
  const double a[] = {1, 2, 2}, b[] = {1, 0, 2};
  const int d = 3;
  EXPECT_EQ(Dot(a, b, d), 5);              // a . b
  EXPECT_EQ(SquaredDistance(a, b, d), 4);  // |a - b|^2
  EXPECT_EQ(Distance(a, b, d), 2);         // |a - b|
  EXPECT_EQ(WithDimension(d, [&](auto known) { return Dot(a, b, known() > 0 ? known() : d); }), 5);

  std::vector<std::uint32_t> ids = {4, 1};
  std::vector<std::byte> message;
  Pack(7, &message);
  PackAll(ids, &message);
  Parcel parcel(message);
  const int seven = parcel.Unpack<int>();
  parcel.UnpackAll(&ids);
  EXPECT_EQ(seven, 7);
  EXPECT_EQ(ids, (std::vector<std::uint32_t>{4, 1}));

  std::vector<int> own, near;
  const Peers& peers = NoPeers();
  const std::vector<Peers::Bytes> all = peers.ToAll(message);  // all[peers.part()] is our own
  const Peers::Sums sums = peers.Sum(own.size());
  const std::uint64_t first = sums.before;  // our things are numbered from this on
  EXPECT_EQ(all[0], message);
  EXPECT_EQ(first, 0u);

  const std::vector<double> sample = {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0};
  const double point[] = {3, 0, 0}, halo = 100;
  const Boxes boxes(sample, d, 4);
  const int owner = boxes.OwnerOf(point);
  boxes.ForEachNear(point, halo, [&](int part) { near.push_back(part); });
  EXPECT_EQ(std::count(near.begin(), near.end(), owner), 1);
  EXPECT_EQ(near.size(), 4u);
  const Territory territory(peers, Boxes(sample, d, peers.parts()));
  if (territory.Owns(point)) own.push_back(0);
  EXPECT_EQ(own.size(), 1u);

  std::vector<int> walls;
  const WallSet edge = SetOfWall(0) | SetOfWall(2);  // where walls 0 and 2 meet
  ForEachWall(edge, [&](int wall) { walls.push_back(wall); });
  EXPECT_EQ(walls, (std::vector<int>{0, 2}));
}

TEST(HeaderExamples, OfTheBallTree) {
  const int d = 2;
  std::vector<double> coordinates = {0, 0, 1, 0, 5, 0};
  const double q[] = {0.25, 0}, influence = 1, radius = 0.5;
  std::vector<std::uint32_t> ids, influencing;
  BallTree tree(d, &coordinates);
  for (int i = 0; i < 3; ++i) tree.Insert(influence);
  tree.Gather(q, radius, &ids);
  tree.ForEachInfluencing(q, [&](std::uint32_t id) { influencing.push_back(id); });
  EXPECT_EQ(ids.size(), 2u);
  EXPECT_EQ(influencing.size(), 2u);
  std::pair<double, std::uint32_t> nearest[2];
  const int found = FindNearest(tree, q, 2, nearest);
  EXPECT_EQ(found, 2);
  EXPECT_EQ(nearest[1].second, 1u);
}

TEST(HeaderExamples, OfQuestionsAndAnswers) {
  Specification spec = UnitSphere(Eigen::Vector3d(0, 0, 2));
  QueryBlock block;  // the points of M nearest to two points of space, and tangent bases there
  block.points = (Eigen::MatrixXd(3, 2) << 2, 0, 0, 3, 0, 0).finished();
  block.want.tangents = true;
  EXPECT_EQ(block.size(), 2);
  block.want.tangents = false;
  AnswerBlock answer = AnswerBlock::Shape(spec.dimension, spec.walls, block, block.size());
  answer.points = block.points.colwise().normalized();
  const Status status = CheckAnswers(spec, block, 0, answer);
  EXPECT_TRUE(status.ok()) << status.message;
}

TEST(HeaderExamples, OfAMesh) {
  Specification spec = UnitSphere(Eigen::Vector3d(0, 0, 2));
  std::size_t used = 0;
  spec.epsilon = 0.5, spec.criteria.max_deviation.reset();
  const Status status = MeshIt(spec, [&](const auto& points, const auto& simplices) {
    used = simplices.size();
    EXPECT_EQ(points.rows(), 3);
  });
  EXPECT_TRUE(status.ok()) << status.message;
  EXPECT_GT(used, 0u);

  const auto mesher = std::move(*Mesher::Create(spec));
  Triangles triangles;
  while (const auto batch = mesher->NextBatch()) {
    const MeshDelta delta = *mesher->Absorb(AnswersTo(*batch));
    for (const auto& ids : TrianglesOf(delta.removed)) triangles.erase(ids);
    for (const auto& ids : TrianglesOf(delta.added)) triangles.insert(ids);
  }
  EXPECT_EQ(triangles, TrianglesOf(mesher->Simplices()));
  const Progress& now = mesher->progress();
  std::cerr << PhaseName(now.phase) << ": " << 100 * now.fraction << " %\n";
  EXPECT_EQ(now.fraction, 1);
  const Report& report = mesher->report();
  if (!report.failure.ok()) std::cerr << report.failure.message << '\n';
  if (!report.certificate.certified) std::cerr << report.certificate.verdict << '\n';
  EXPECT_TRUE(report.certificate.certified);
}

TEST(HeaderExamples, OfAMeshView) {
  const std::vector<double> points(12), tangents(24);
  const std::vector<std::uint32_t> triangles = {0, 1, 2, 0, 1, 3, 0, 2, 3, 1, 2, 3};
  MeshView mesh{2, 3, 4, points.data(), tangents.data(), &triangles};  // four points of space
  EXPECT_EQ(mesh.Point(1) - mesh.points, 3);
}

// A ring of points on a circle.
TEST(HeaderExamples, OfAReconstruction) {
  const int count = 60;
  Eigen::MatrixXd points(2, count);
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    points.col(i) = Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  std::vector<std::uint32_t> used;
  const auto Use = [&](const std::vector<std::uint32_t>& simplices) { used = simplices; };
  {
    ReconstructionSpecification spec;
    spec.dimension = 2, spec.ambient_dimension = 3;
    spec.closed = false;  // M may end
    EXPECT_TRUE(Validate(spec).ok());
  }
  ReconstructionSpecification spec;
  spec.dimension = 1, spec.ambient_dimension = 2;
  {
    const auto result = Reconstruct(spec, {points, {}});
    if (result && result->report.certificate.certified) Use(result->simplices);
    ASSERT_TRUE(result.has_value()) << result.error().message;
  }
  EXPECT_EQ(used.size(), 2u * count);
  Expected<Reconstruction> result = Reconstruct(spec, {points, {}});
  for (const Place place : result->places)
    if (place == Place::kNoise) std::cerr << PlaceName(place) << ": " << PlaceAdvice(place);
  ReconstructionWatch watch;
  std::thread reconstructing([&] { result = Reconstruct(spec, {points, {}}, {}, &watch); });
  watch.Interrupt();
  reconstructing.join();  // soon
  EXPECT_TRUE(result.has_value() || result.error().code == StatusCode::kCancelled);
}

}  // namespace header_examples
}  // namespace stellate::core
