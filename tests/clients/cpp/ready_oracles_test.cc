// The ready oracles: the laws of all oracles, the doctor's blessing, closed forms, and refusals.
#include "support/ready_oracles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <random>
#include <thread>

#include "stellate/catalogue.h"
#include "stellate/doctor.h"
#include "stellate/oracles.h"
#include "stellate/oracles/combined.h"
#include "support/oracle_invariants.h"

namespace stellate::oracles {
namespace {

using ::testing::HasSubstr;
using Vector = Eigen::VectorXd;
using testing::MakeReadyOracle;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

BoundingBox Cube(int d, double half) {
  return {Vector::Constant(d, -half), Vector::Constant(d, half)};
}

std::shared_ptr<Oracle> Torus() { return MakeManifold("torus:1:0.4").value(); }

Eigen::MatrixXd Scattered(int d, int count, double half) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> number(-half, half);
  Eigen::MatrixXd points(d, count);
  for (double& coordinate : points.reshaped()) coordinate = number(random);
  return points;
}

// Points at most `away` off the torus.
Eigen::MatrixXd NearTorus(int count, double away) {
  return Torus()->ClosestPoint(Scattered(3, count, 1.5)).points + Scattered(3, count, away / 2);
}

class Each : public ::testing::TestWithParam<std::string> {
 protected:
  const std::unique_ptr<Oracle> oracle_ = MakeReadyOracle(GetParam());
};

class Lawful : public Each {};
class Blessed : public Each {};

TEST_P(Lawful, KeepsTheLawsOfOracles) {
  testing::InvariantOptions options;
  options.samples = 30;
  options.clearance = 0.03;
  options.tolerance = 1e-7;
  EXPECT_TRUE(testing::OracleInvariantsHold(*oracle_, options));
}

TEST_P(Blessed, HasTheDoctorsBlessing) {
  const CheckReport report = Check(*oracle_).value();
  EXPECT_TRUE(report.ok()) << ToText(report);
}

TEST_P(Each, AnswersThreadsAsOneCaller) {
  const std::optional<BoundingBox> box = oracle_->bounding_box();
  ASSERT_TRUE(box);
  const Eigen::MatrixXd shares = Scattered(oracle_->ambient_dimension(), 40, 0.5).array() + 0.5;
  const Eigen::MatrixXd x =
      ((box->upper - box->lower).asDiagonal() * shares).colwise() + box->lower;
  const Answer alone = oracle_->ClosestPoint(x);
  std::vector<Answer> answers(4);
  std::vector<std::thread> threads;
  for (Answer& answer : answers) {
    threads.emplace_back([&answer, &x, this] { answer = oracle_->ClosestPoint(x); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Answer& answer : answers) {
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      ASSERT_EQ(answer.IsFound(j), alone.IsFound(j));
      if (!alone.IsFound(j)) continue;
      ASSERT_EQ(answer.points.col(j), alone.points.col(j));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Ready, Each, ::testing::ValuesIn(testing::ReadyOracles()),
                         [](const auto& one) { return one.param; });

std::vector<std::string> AllBut(std::initializer_list<const char*> others) {
  std::vector<std::string> names = testing::ReadyOracles();
  for (const char* other : others) std::erase(names, other);
  return names;
}

// Noise moves nearest points by more than the doctor lets pass.
INSTANTIATE_TEST_SUITE_P(Ready, Blessed, ::testing::ValuesIn(AllBut({"uneven_cloud"})),
                         [](const auto& one) { return one.param; });

// A linkage's closest point from afar is one of several, each the closest of its neighbours; what
// is fitted to points has tangents that are M's to second order.
INSTANTIATE_TEST_SUITE_P(Ready, Lawful,
                         ::testing::ValuesIn(AllBut({"linkage", "point_cloud", "uneven_cloud",
                                                     "triangle_mesh"})),
                         [](const auto& one) { return one.param; });

struct Likeness {
  std::string name;
  double error;  // of the torus of radii 1 and 0.4, a length
};
void PrintTo(const Likeness& likeness, std::ostream* out) { *out << likeness.name; }

class OfATorus : public ::testing::TestWithParam<Likeness> {};

TEST_P(OfATorus, IsTheTorus) {
  const auto oracle = MakeReadyOracle(GetParam().name);
  const Eigen::MatrixXd x = NearTorus(100, 0.1);
  const Answer answer = oracle->ClosestPoint(x);
  const Eigen::MatrixXd exact = Torus()->ClosestPoint(x).points;
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    ASSERT_TRUE(answer.IsFound(j));
    EXPECT_LE((answer.points.col(j) - exact.col(j)).norm(), GetParam().error);
  }
}

INSTANTIATE_TEST_SUITE_P(Ready, OfATorus,
                         ::testing::Values(Likeness{"parametrized", 1e-10},
                                           Likeness{"parametrized_differences", 1e-7},
                                           Likeness{"signed_distance", 1e-7},
                                           Likeness{"grid", 0.025}, Likeness{"point_cloud", 0.012},
                                           Likeness{"uneven_cloud", 0.012},
                                           Likeness{"triangle_mesh", 0.009}));

TEST(Linkage, KnowsItsJoints) {
  Linkage linkage({{"a", "p", 1.0}, {"p", "q", 1.3}, {"q", "b", 1.1}, {"q", "r", 0.5}},
                  {{"a", Eigen::Vector2d(0, 0)}, {"b", Eigen::Vector2d(1.5, 0)}});
  EXPECT_THAT(linkage.moving(), ::testing::ElementsAre("p", "q", "r"));
  EXPECT_EQ(linkage.dimension(), 2);
  const Answer answer = linkage.ClosestPoint(Scattered(6, 50, 1));
  const auto joints = linkage.Joints(answer.points);
  int found = 0;
  for (Eigen::Index j = 0; j < 50; ++j) {
    if (!answer.IsFound(j)) continue;
    ++found;
    EXPECT_NEAR((joints.at("p") - joints.at("q")).col(j).norm(), 1.3, 1e-10);
    EXPECT_NEAR((joints.at("q") - joints.at("b")).col(j).norm(), 1.1, 1e-10);
  }
  EXPECT_GT(found, 40);
  EXPECT_THROW(linkage.Joints(Vector::Zero(4)), std::invalid_argument);
}

TEST(Product, HasSeedsWhereAFactorHas) {
  struct Seeded final : public PointwiseOracle {
    Seeded() : PointwiseOracle(1, 2) {}
    Eigen::MatrixXd seeds() const override { return Eigen::Matrix2d::Identity(); }
    bool Project(const Vector& x, Vector& y) const override {
      y = x.normalized();
      return true;
    }
    void Tangent(const Vector& y, Eigen::MatrixXd& t) const override {
      t = Eigen::Vector2d(-y[1], y[0]);
    }
  };
  const auto seeded = std::make_shared<Seeded>();
  const Product two({seeded, seeded});
  EXPECT_EQ(two.seeds().cols(), 4);
  EXPECT_FALSE(two.bounding_box());
  const Product mixed({seeded, Torus()});
  EXPECT_EQ(mixed.seeds().cols(), 2);
  EXPECT_EQ(mixed.seeds().rows(), 5);
}

TEST(Transformed, GivesFlatsUpInMoreDimensions) {
  EXPECT_TRUE(Transformed(Torus(), {{}, 2, {}}).has_intersect_flat());
  EXPECT_FALSE(Transformed(Torus(), {Eigen::MatrixXd::Identity(4, 3), 1, {}}).has_intersect_flat());
}

const Triangles kTetrahedron{
    (Eigen::MatrixXd(3, 4) << 1, 1, -1, -1, 1, -1, 1, -1, 1, -1, -1, 1).finished(),
    (Eigen::MatrixXi(3, 4) << 0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3).finished()};

TEST(TriangleMesh, FillsLargeTriangles) {
  TriangleMesh tetrahedron(kTetrahedron, {0.1, {}});
  const Eigen::Vector3d middle = kTetrahedron.points.leftCols(3).rowwise().mean();
  EXPECT_LT((tetrahedron.ClosestPoint(1.1 * middle).points - middle).norm(), 1e-9);
}

class Files : public ::testing::Test {
 protected:
  Files() { std::filesystem::create_directories(folder_); }
  ~Files() override { std::filesystem::remove_all(folder_); }
  std::string Written(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  const std::filesystem::path folder_ = std::filesystem::path(::testing::TempDir()) /
                                        ("stellate-ready-oracles-" + std::to_string(getpid()));
};

TEST_F(Files, TrianglesAreReadExactly) {
  const std::string corners = "1 1 1\n1 -1 -1\n-1 1 -1\n-1 -1 0.1\n";
  const std::string off =
      Written("a.off", "OFF\n4 4 0\n" + corners + "3 0 1 2\n3 0 1 3\n3 0 2 3\n3 1 2 3\n");
  const std::string obj = Written(
      "a.obj", "v 1 1 1\nv 1 -1 -1\nv -1 1 -1\nv -1 -1 0.1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n");
  for (const std::string& file : {off, obj}) {
    const Triangles read = ReadTriangles(file);
    ASSERT_EQ(read.points.cols(), 4) << file;
    EXPECT_EQ(read.points(2, 3), 0.1) << file;  // all digits of it
    EXPECT_EQ(read.corners, kTetrahedron.corners) << file;
    EXPECT_EQ(TriangleMesh(file, {0.2, {}}).dimension(), 2);
  }
  const Triangles square =
      ReadTriangles(Written("b.off", "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
  EXPECT_EQ(square.corners.cols(), 2);
}

struct Wrong {
  std::string words;
  std::function<void()> make;
};
void PrintTo(const Wrong& wrong, std::ostream* out) { *out << wrong.words; }

class Refused : public ::testing::TestWithParam<Wrong> {};

TEST_P(Refused, WithWords) {
  try {
    GetParam().make();
    FAIL() << "it was taken";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), HasSubstr(GetParam().words));
  }
}

TEST(Parametrized, MayComeRoundTurnedOver) {
  const auto klein = [](const Vector& u) -> Vector {
    const double ring = 2 + std::cos(u[1]), across = std::sin(u[1]);
    return Eigen::Vector4d(ring * std::cos(u[0]), ring * std::sin(u[0]),
                           across * std::cos(u[0] / 2), across * std::sin(u[0] / 2));
  };
  const double turn = 2 * std::numbers::pi;
  const auto turns = [&](double share) {
    return Chart{klein, {}, Vector::Zero(2), Eigen::Vector2d(share * turn, turn), {true}};
  };
  EXPECT_NO_THROW(Parametrized(turns(1)));  // after one it is at the other side, and M the same
  EXPECT_NO_THROW(Parametrized(turns(2)));
  EXPECT_THROW(Parametrized(turns(0.9)), std::invalid_argument);
}

Chart Interval(double lower, double upper, Eigen::Index d) {
  return {[d](const Vector& u) { return Vector::Constant(d, u[0]); },
          {},
          Vector::Constant(1, lower),
          Vector::Constant(1, upper),
          {}};
}
Triangles Without(Eigen::Index count) {
  return {kTetrahedron.points, kTetrahedron.corners.leftCols(4 - count)};
}
Triangles Shifted() { return {kTetrahedron.points, kTetrahedron.corners.array() + 1}; }
Vector Circle(const Vector& x) { return Vector::Constant(1, x.squaredNorm() - 1); }
const Linkage::Places kGround = {{"a", Eigen::Vector2d(0, 0)}, {"b", Eigen::Vector2d(1.5, 0)}};
Vector Grid(Eigen::Index count) { return Vector::LinSpaced(count, -1, 1); }

INSTANTIATE_TEST_SUITE_P(
    Wrong, Refused,
    ::testing::Values(
        Wrong{"closed", [] { TriangleMesh{Without(1)}; }},
        Wrong{"name points from 0 to 3", [] { TriangleMesh{Shifted()}; }},
        Wrong{"name points from 0 to 3", [] { TriangleMesh{Without(4)}; }},
        Wrong{"cannot be read", [] { TriangleMesh{"no such file.obj"}; }},
        Wrong{"larger one",
              [] {
                TriangleMesh(kTetrahedron, {1e-4, {}});
              }},
        Wrong{"spacing has to be positive",
              [] {
                TriangleMesh(kTetrahedron, {kNaN, {}});
              }},
        Wrong{"not finite", [] { PointCloud(Eigen::MatrixXd::Constant(2, 30, kNaN), 1); }},
        Wrong{"there are none", [] { PointCloud(Eigen::MatrixXd(), 1); }},
        Wrong{"too few, at least 7 are", [] { PointCloud(Eigen::MatrixXd::Identity(3, 3), 1); }},
        Wrong{"whole number from 1 to 2", [] { PointCloud(Scattered(3, 40, 1), 3); }},
        Wrong{"has to be positive", [] { PointCloud(Scattered(3, 40, 1), 2, -1); }},
        Wrong{"larger bandwidth", [] { PointCloud(Scattered(3, 40, 1), 2, 1e-6); }},
        Wrong{"one chart at least", [] { Parametrized(std::vector<Chart>{}); }},
        Wrong{"lower < upper", [] { Parametrized(Interval(1, 1, 2)); }},
        Wrong{"has to be finite",
              [] { Parametrized(Interval(0, std::numeric_limits<double>::infinity(), 2)); }},
        Wrong{"the first has to", [] { Parametrized(Interval(0, 1, 1)); }},
        Wrong{"charts lead to",
              [] {
                Parametrized(std::vector<Chart>{Interval(0, 1, 2), Interval(0, 1, 3)});
              }},
        Wrong{"come round as periodic says: from the lower end 0 of parameter 0 to the upper 360",
              [] {
                const auto circle = [](const Vector& u) -> Vector {
                  return Eigen::Vector2d(std::cos(u[0]), std::sin(u[0]));
                };
                Parametrized(Chart{circle, {}, Vector::Zero(1), Vector::Constant(1, 360), {true}});
              }},
        Wrong{"two factors", [] { Product({Torus()}); }},
        Wrong{"null",
              [] {
                Product({Torus(), nullptr});
              }},
        Wrong{"orthonormal",
              [] {
                Transformed(Torus(), {2 * Eigen::Matrix3d::Identity(), 1, {}});
              }},
        Wrong{"2 x 2",
              [] {
                Transformed(Torus(), {Eigen::Matrix2d::Identity(), 1, {}});
              }},
        Wrong{"scale",
              [] {
                Transformed(Torus(), {{}, 0, {}});
              }},
        Wrong{"translation",
              [] {
                Transformed(Torus(), {{}, 1, Vector::Zero(2)});
              }},
        Wrong{"leave none",
              [] { LevelSet(Torus(), [](const Vector& x) -> Vector { return x.head(2); }); }},
        Wrong{"needs a function", [] { LevelSet(Torus(), {}); }},
        Wrong{"give a level between them, such as",
              [] {
                SignedDistance::OfGrid(Grid(64), {4, 4, 4}, Cube(3, 1), 2);
              }},
        Wrong{"4 values an axis",
              [] {
                SignedDistance::OfGrid(Grid(48), {3, 4, 4}, Cube(3, 1));
              }},
        Wrong{"has 64 values",
              [] {
                SignedDistance::OfGrid(Grid(63), {4, 4, 4}, Cube(3, 1));
              }},
        Wrong{"a box of R",
              [] {
                SignedDistance::OfGrid(Grid(64), {4, 4, 4}, Cube(2, 1));
              }},
        Wrong{"has to be a function", [] { SignedDistance({}, {}, Cube(2, 1)); }},
        Wrong{"one constraint at least", [] { ConstraintSet(2, {}, Cube(2, 1)); }},
        Wrong{"box of R^3",
              [] {
                ConstraintSet(3, {{Circle, {}}}, Cube(2, 2));
              }},
        Wrong{"leave no manifold",
              [] {
                ConstraintSet(2, {{[](const Vector& x) { return x; }, {}}}, Cube(2, 2));
              }},
        Wrong{"constraint 1 follows",
              [] {
                const auto twice = [](const Vector& x) -> Vector { return 2 * Circle(x); };
                ConstraintSet(3, {{Circle, {}}, {twice, {}}}, Cube(3, 2));
              }},
        Wrong{"no point was found",
              [] {
                const auto never = [](const Vector& x) {
                  return Vector::Constant(1, x.squaredNorm() + 1);
                };
                ConstraintSet(3, {{never, {}}}, Cube(3, 2));
              }},
        Wrong{"no gradient of its own",
              [] {
                const auto square = [](const Vector& x) -> Vector { return Circle(x).cwiseAbs2(); };
                ConstraintSet(3, {{square, {}}}, Cube(3, 2));
              }},
        Wrong{"leave nothing to move",
              [] {
                Linkage({{"a", "p", 1}, {"p", "b", 1}}, kGround);
              }},
        Wrong{"no bar has the fixed joint b at an end",
              [] {
                Linkage({{"a", "p", 1}}, kGround);
              }},
        Wrong{"no chain",
              [] {
                Linkage({{"p", "q", 1}}, kGround);
              }},
        Wrong{"two joints that are fixed",
              [] {
                Linkage({{"a", "b", 1}}, kGround);
              }},
        Wrong{"too short",
              [] {
                Linkage({{"a", "p", 0.1}, {"p", "b", 0.1}, {"p", "q", 1}, {"q", "s", 1}}, kGround);
              }},
        Wrong{"length > 0",
              [] {
                Linkage({{"a", "p", 0}}, kGround);
              }},
        Wrong{"one joint at least", [] {
                Linkage({{"a", "p", 1}}, {});
              }}));

}  // namespace
}  // namespace stellate::oracles
