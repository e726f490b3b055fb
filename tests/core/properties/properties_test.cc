// Laws that hold for any manifold in any place, unit and position, tried on random ones. The
// default run tries a few, property_campaign many.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/transformed.h"
#include "tests/core/support/trials.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ForEachTrial;
using testing::Make;
using testing::Motion;
using testing::RandomSignedPermutation;
using testing::RandomTurn;
using testing::SpecificationFor;
using testing::Transformed;

struct Shape {
  const char* manifold;
  double epsilon;
  // Neither do its tangent bases turn round because of rounding, nor is anything else decided by a
  // hair.
  bool steady = true;
  // How far from the origin it can be, in epsilon. The tangents of rotations are taken from their
  // entries, and are orthonormal no longer where these have been rounded too much.
  double far = 1e12;
};

// The lattice that samples the flat torus is as symmetric as that: of the 46 circumcentres
// that are asked for first when it is refined, seven have the radius of another to twelve digits,
// and which of them goes first, rounding decides.
constexpr Shape kShapes[] = {{"circle:3", 0.3},
                             {"ellipsoid:2:1", 0.2},
                             {"torus-knot:2:3", 0.2},
                             {"torus", 0.25},
                             {"ellipsoid", 0.25},
                             {"clifford-torus", 0.3},
                             {"rp2:5", 0.35, false},
                             {"two-spheres", 0.3},
                             {"so3", 0.8, true, 1e10},
                             {"flat-torus:3", 0.7, false},
                             {"ellipsoid:1:0.9:0.8:0.76", 0.45}};

void PrintTo(const Shape& s, std::ostream* out) { *out << s.manifold; }

// One manifold, tried in `trials` ways; each has a seed, which its failures name.
class Properties : public ::testing::TestWithParam<Shape> {
 protected:
  Properties() : manifold_(Make(GetParam().manifold)), epsilon_(GetParam().epsilon) {}

  int d() const { return manifold_->ambient_dimension(); }

  template <typename Trial>
  void Try(const Trial& trial, std::uint64_t by_default = 2) {
    ForEachTrial(by_default, [&](std::uint64_t seed) {
      Random random(seed, 7);
      trial(seed, random);
    });
  }

  // The certificate is the manifold's, by this program's own count.
  void ExpectItsCertificate(const DrivenRun& run, double epsilon) const {
    const ManifoldFacts& facts = manifold_->facts();
    const Certificate& c = run.report().certificate;
    ASSERT_EQ(run.report().termination, Termination::kConverged) << c.verdict;
    EXPECT_TRUE(c.certified) << c.verdict;
    const auto topology = testing::TopologyOf(run.mesher->Simplices(), facts.dimension);
    EXPECT_TRUE(topology.closed);
    EXPECT_EQ(topology.euler_characteristic, facts.euler_characteristic);
    EXPECT_EQ(topology.components, static_cast<std::uint64_t>(facts.betti_mod2[0]));
    EXPECT_EQ(c.orientable, facts.orientable);
    EXPECT_LE(c.max_circumradius, epsilon * (1 + 1e-9));
  }

  Motion RandomMotion(Random& random, double decades, double far) const {
    Motion motion = Motion::None(d());
    motion.scale = std::pow(10.0, decades * (2 * random.Uniform() - 1));
    motion.turn = RandomTurn(d(), random);
    for (int i = 0; i < d(); ++i) motion.shift[i] = far * motion.scale * random.NearlyNormal();
    return motion;
  }

  std::unique_ptr<Manifold> manifold_;
  double epsilon_;
};

// Doubling the unit doubles every number of the run and changes no decision.
TEST_P(Properties, PowersOfTwoChangeNothing) {
  Try([&](std::uint64_t seed, Random& random) {
    Specification spec = SpecificationFor(*manifold_, epsilon_);
    spec.random_seed = seed;
    spec.oracle.intersect_flat = random.Uniform() < 0.5;
    spec.oracle.tangent_basis = random.Uniform() < 0.7;
    spec.criteria.speculative = random.Uniform() < 0.3;
    if (manifold_->has_local_size() && manifold_->dimension() < 3 && random.Uniform() < 0.5) {
      spec.oracle.local_size = random.Uniform() < 0.5;
      spec.criteria.size_rate = 0.5;
    }
    const DrivenRun plain = Drive(spec, *manifold_);
    Motion motion = Motion::None(d());
    motion.scale = std::ldexp(1.0, static_cast<int>(81 * random.Uniform()) - 40);
    Transformed scaled(*manifold_, motion);
    Specification scaled_spec = spec;
    scaled_spec.epsilon = motion.scale * epsilon_;
    const auto box = *scaled.bounding_box();
    scaled_spec.bounding_box = BoundingBox{box.lower, box.upper};
    const DrivenRun run = Drive(scaled_spec, scaled);
    EXPECT_EQ(run.mesher->Points() / motion.scale, plain.mesher->Points()) << motion.scale;
    EXPECT_EQ(run.mesher->Simplices(), plain.mesher->Simplices()) << motion.scale;
    EXPECT_EQ(run.report().counts.rounds, plain.report().counts.rounds);
    EXPECT_EQ(run.report().certificate.certified, plain.report().certificate.certified);
  });
}

// Where axes change places sums round differently, and what is decided by a hair may be decided
// otherwise: on steady manifolds nothing is.
TEST_P(Properties, AxesMayChangePlacesAndDirections) {
  Try([&](std::uint64_t seed, Random& random) {
    Specification spec = SpecificationFor(*manifold_, epsilon_);
    spec.random_seed = seed;
    spec.seeds = testing::RandomPointsOn(*manifold_, 20, seed);
    const DrivenRun plain = Drive(spec, *manifold_);
    ExpectItsCertificate(plain, epsilon_);
    for (const bool permute : {false, true}) {
      Motion motion = Motion::None(d());
      motion.turn = RandomSignedPermutation(d(), random, permute);
      Transformed turned(*manifold_, motion);
      Specification turned_spec = SpecificationFor(turned, epsilon_);
      turned_spec.random_seed = seed;
      turned_spec.seeds = turned.Moved(spec.seeds);
      const DrivenRun run = Drive(turned_spec, turned);
      ExpectItsCertificate(run, epsilon_);
      if (permute && !GetParam().steady) continue;
      const Eigen::MatrixXd expected = turned.Moved(plain.mesher->Points());
      if (permute) {
        ASSERT_EQ(run.mesher->Points().cols(), expected.cols());
        EXPECT_LE((run.mesher->Points() - expected).cwiseAbs().maxCoeff(), 1e-9);
      } else {
        EXPECT_EQ(run.mesher->Points(), expected);
      }
      EXPECT_EQ(run.mesher->Simplices(), plain.mesher->Simplices());
    }
  });
}

// Any unit, any position, any random seed, with what oracle there is.
TEST_P(Properties, UnitsAndPositionsKeepTheCertificate) {
  Try([&](std::uint64_t seed, Random& random) {
    Transformed moved(*manifold_, RandomMotion(random, 6, 10));
    const double epsilon = epsilon_ * moved.LengthUnit();
    Specification spec = SpecificationFor(moved, epsilon);
    spec.random_seed = seed;
    spec.oracle.intersect_flat = random.Uniform() < 0.5;
    spec.oracle.tangent_basis = random.Uniform() < 0.7;
    spec.criteria.speculative = random.Uniform() < 0.3;
    ExpectItsCertificate(Drive(spec, moved), epsilon);
  });
}

// Coordinates then have some three decimal digits left below epsilon.
TEST_P(Properties, FarFromTheOriginIsLikeAnywhere) {
  Try([&](std::uint64_t seed, Random& random) {
    Motion motion = RandomMotion(random, 6, 0);
    Eigen::VectorXd away(d());
    for (int i = 0; i < d(); ++i) away[i] = random.NearlyNormal();
    const double epsilon = epsilon_ * motion.scale;
    motion.shift = GetParam().far * epsilon * away.normalized();
    Transformed moved(*manifold_, motion);
    Specification spec = SpecificationFor(moved, epsilon);
    spec.random_seed = seed;
    spec.oracle.tangent_basis = random.Uniform() < 0.7;
    spec.oracle.intersect_flat = random.Uniform() < 0.5;
    ExpectItsCertificate(Drive(spec, moved), epsilon);
  });
}

// Farther than numbers can tell points apart, the run is refused and says why.
TEST(TooFar, IsRefused) {
  const auto torus = Make("torus");
  Motion motion = Motion::None(3);
  motion.shift.setConstant(1e14 * 0.25);
  Transformed moved(*torus, motion);
  const auto mesher = testing::NewMesher(SpecificationFor(moved, 0.25));
  ASSERT_TRUE(mesher->Absorb(testing::AnswersOf(moved, *mesher->NextBatch())));
  const auto refused = mesher->Absorb(testing::AnswersOf(moved, *mesher->NextBatch()));
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, StatusCode::kOracleNotIdempotent) << refused.error().message;
  EXPECT_NE(refused.error().message.find("move the manifold nearer"), std::string::npos)
      << refused.error().message;
}

// A number in [-1, 1) that depends on a point and an index alone.
double Noise(const Eigen::Ref<const Eigen::VectorXd>& x, std::uint64_t index) {
  std::uint64_t h = Mix64(index);
  for (Eigen::Index i = 0; i < x.size(); ++i) h = Mix64(h ^ std::bit_cast<std::uint64_t>(x[i]));
  return static_cast<double>(h >> 11) * 0x1p-52 - 1;
}

// A solver's errors, by the point it answers: half of what idempotence allows, in a direction of
// its own. Tangent spaces are turned by up to 0.03.
constexpr double kPointNoise = 0.5e-3;  // of epsilon
constexpr double kTangentNoise = 0.03;

TEST_P(Properties, NoiseAtTheTolerancesKeepsTheCertificate) {
  Try([&](std::uint64_t seed, Random& random) {
    Transformed moved(*manifold_, RandomMotion(random, 3, 1));
    const double epsilon = epsilon_ * moved.LengthUnit();
    Specification spec = SpecificationFor(moved, epsilon);
    spec.random_seed = seed;
    spec.oracle.intersect_flat = false;  // noise leaves flats
    const int k = manifold_->dimension();
    const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
      Answers answers = testing::AnswersOf(moved, batch);
      for (AnswerBlock& block : answers.blocks) {
        for (Eigen::Index j = 0; j < block.points.cols(); ++j) {
          const Eigen::VectorXd at = block.points.col(j);
          Eigen::VectorXd off(d());
          for (int i = 0; i < d(); ++i) off[i] = Noise(at, static_cast<std::uint64_t>(i));
          block.points.col(j) += kPointNoise * epsilon / std::max(off.norm(), 1.0) * off;
          if (block.tangents.size() == 0) continue;
          Eigen::MatrixXd basis(d(), k);
          for (int i = 0; i < d(); ++i)
            for (int a = 0; a < k; ++a) basis(i, a) = block.tangents(i * k + a, j);
          basis.col(0) += kTangentNoise / std::max(off.norm(), 1.0) * off;
          const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(basis).householderQ() *
                                    Eigen::MatrixXd::Identity(d(), k);
          for (int i = 0; i < d(); ++i)
            for (int a = 0; a < k; ++a) block.tangents(i * k + a, j) = q(i, a);
        }
      }
      return answers;
    });
    ExpectItsCertificate(run, epsilon);
  });
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Properties, ::testing::ValuesIn(kShapes),
                         [](const auto& shape) {
                           std::string name = shape.param.manifold;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

// Samples that are as symmetric as can be: neighbours cospherical by the dozen, and repeated.

struct Symmetric {
  const char* name;
  const char* manifold;
  double epsilon;
  Eigen::MatrixXd (*seeds)();
};

void PrintTo(const Symmetric& s, std::ostream* out) { *out << s.name; }

// n^k angles on a product of k circles.
template <int K, int N>
Eigen::MatrixXd Grid() {
  const testing::FramedPoints grid = testing::TorusGrid(K, N);
  return Eigen::Map<const Eigen::MatrixXd>(grid.points.data(), 2 * K, grid.size());
}

Eigen::MatrixXd OnTheTorus() {
  const int n = 16, m = 8;
  Eigen::MatrixXd seeds(3, n * m);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < m; ++j) {
      const double u = 2 * M_PI * i / n, v = 2 * M_PI * j / m;
      seeds.col(i * m + j) << (1 + 0.4 * std::cos(v)) * std::cos(u),
          (1 + 0.4 * std::cos(v)) * std::sin(u), 0.4 * std::sin(v);
    }
  return seeds;
}

// Longitudes and latitudes, poles included.
Eigen::MatrixXd OnTheSphere() {
  const int n = 12, m = 6;
  Eigen::MatrixXd seeds(3, n * (m - 1) + 2);
  for (int j = 1; j < m; ++j)
    for (int i = 0; i < n; ++i) {
      const double u = 2 * M_PI * i / n, v = M_PI * j / m;
      seeds.col((j - 1) * n + i) << std::sin(v) * std::cos(u), std::sin(v) * std::sin(u),
          std::cos(v);
    }
  seeds.rightCols(2) << 0, 0, 0, 0, 1, -1;
  return seeds;
}

// The 24 rotations of a cube.
Eigen::MatrixXd OfTheCube() {
  Eigen::MatrixXd seeds(9, 24);
  int count = 0;
  for (int code = 0; code < 48; ++code) {
    int axes[3] = {code % 3, 0, 0};
    axes[1] = (axes[0] + 1 + code / 3 % 2) % 3;
    axes[2] = 3 - axes[0] - axes[1];
    Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 3; ++i) m(i, axes[i]) = code / 6 >> i & 1 ? -1 : 1;
    const Eigen::Vector3d u = m.row(0), v = m.row(1), w = m.row(2);
    const double determinant = u.dot(v.cross(w));
    if (determinant < 0) continue;
    for (int i = 0; i < 9; ++i) seeds(i, count) = m(i / 3, i % 3);
    ++count;
  }
  return seeds;
}

const Symmetric kSymmetric[] = {
    {"circle", "circle", 0.3, Grid<1, 18>},     {"clifford", "flat-torus:2", 0.4, Grid<2, 12>},
    {"torus", "torus", 0.25, OnTheTorus},       {"sphere", "sphere:2", 0.4, OnTheSphere},
    {"cubes", "flat-torus:3", 0.8, Grid<3, 6>}, {"rotations", "so3", 0.8, OfTheCube},
};

class SymmetricSamples : public ::testing::TestWithParam<Symmetric> {};

TEST_P(SymmetricSamples, MeshLikeAnyOthers) {
  const auto manifold = Make(GetParam().manifold);
  const int d = manifold->ambient_dimension();
  bool exact = true;  // the first
  ForEachTrial(3, [&](std::uint64_t seed) {
    Random random(seed, 8);
    Motion motion = Motion::None(d);
    if (!std::exchange(exact, false)) {
      motion.scale = std::pow(10.0, 12 * random.Uniform() - 6);
      motion.turn =
          random.Uniform() < 0.5 ? RandomTurn(d, random) : RandomSignedPermutation(d, random, true);
    }
    Transformed moved(*manifold, motion);
    const double epsilon = GetParam().epsilon * motion.scale;
    Specification spec = SpecificationFor(moved, epsilon);
    spec.random_seed = seed;
    const Eigen::MatrixXd seeds = moved.Moved(GetParam().seeds());
    // Each thrice: as it is, once more, and off by rounding.
    spec.seeds.resize(d, 3 * seeds.cols());
    spec.seeds << seeds, seeds, seeds * (1 + 1e-15);
    spec.criteria.speculative = random.Uniform() < 0.3;
    const DrivenRun run = Drive(spec, moved);
    const Certificate& c = run.report().certificate;
    ASSERT_EQ(run.report().termination, Termination::kConverged) << c.verdict;
    EXPECT_TRUE(c.certified) << c.verdict;
    EXPECT_EQ(c.euler_characteristic, manifold->facts().euler_characteristic);
    EXPECT_GE(run.report().counts.duplicates, static_cast<std::uint64_t>(2 * seeds.cols()));
    EXPECT_EQ(testing::TopologyOf(run.mesher->Simplices(), manifold->dimension()).used_vertices,
              static_cast<std::uint64_t>(run.mesher->Points().cols()));
  });
}

INSTANTIATE_TEST_SUITE_P(Grids, SymmetricSamples, ::testing::ValuesIn(kSymmetric),
                         [](const auto& s) { return std::string(s.param.name); });

}  // namespace
}  // namespace stellate::core
