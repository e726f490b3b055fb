#include "core/certificate/certifier.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "core/base/random.h"
#include "tests/core/certificate/handmade_meshes.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Says;

ClosestPoint OnRevolution(double big, double small) {
  return [big, small](const Eigen::VectorXd& x) { return ClosestOnRevolution(big, small, x); };
}

HandmadeMesh RevolutionGrid(int n, double big, double small) {
  return TorusGrid(2, n, [&](const Eigen::VectorXd& a) { return RevolutionPoint(big, small, a); });
}

// The sphere of radius 1 and another one elsewhere.
ClosestPoint TwoSpheres(const Eigen::Vector3d& centre, double radius) {
  return [centre, radius](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    const Eigen::VectorXd a = x.normalized();
    const Eigen::VectorXd b = centre + radius * (x - centre).normalized();
    return (x - a).norm() <= (x - b).norm() ? a : b;
  };
}

TEST(Certifier, CertifiesASphere) {
  const HandmadeMesh mesh = Icosphere(3);
  const CertifiedRun run = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere);
  const Certificate& c = run.certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_TRUE(c.closed);
  EXPECT_TRUE(c.links_are_spheres);
  EXPECT_TRUE(c.links_decided_exactly);
  EXPECT_TRUE(c.orientable);
  EXPECT_EQ(c.components, 1u);
  EXPECT_EQ(c.euler_characteristic, 2);
  EXPECT_EQ(c.unembedded_stars, 0u);
  EXPECT_EQ(c.fibre_failures, 0u);
  EXPECT_GT(c.fibre_samples, 100u);
  EXPECT_NEAR(c.estimated_reach, 1, 1e-6);
  EXPECT_NEAR(c.epsilon_over_reach, 0.2, 1e-6);
  EXPECT_GT(c.min_angle_degrees, 30);
  EXPECT_LE(c.max_barycentre_distance, 0.2 * 0.2 / 2);
  EXPECT_GT(c.max_barycentre_distance, 0);
  EXPECT_TRUE(c.warnings.empty()) << c.warnings.front();
}

TEST(Certifier, CertifiesATorusWithTheSmallerOfItsTwoReaches) {
  const HandmadeMesh mesh = RevolutionGrid(48, 1, 0.35);
  const CertifiedRun run = Certify(SpecificationFor(mesh, 0.1), mesh, OnRevolution(1, 0.35));
  EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
  EXPECT_EQ(run.certificate.euler_characteristic, 0);
  EXPECT_TRUE(run.certificate.orientable);
  EXPECT_NEAR(run.certificate.estimated_reach, 0.35, 0.01);
}

TEST(Certifier, CertifiesCurvesAndHigherDimensions) {
  for (const auto& [k, n] : {std::pair{1, 30}, {2, 16}, {3, 12}}) {
    const HandmadeMesh mesh = TorusGrid(k, n, CliffordPoint);
    const double epsilon = 1.001 * std::sqrt(k) * std::sin(std::numbers::pi / n);
    const CertifiedRun run = Certify(SpecificationFor(mesh, epsilon), mesh, ClosestOnClifford);
    EXPECT_TRUE(run.certificate.certified) << k << ": " << run.certificate.verdict;
    EXPECT_EQ(run.certificate.euler_characteristic, 0) << k;
    EXPECT_EQ(run.certificate.components, 1u) << k;
    EXPECT_TRUE(run.certificate.orientable) << k;
    EXPECT_TRUE(run.certificate.links_decided_exactly) << k;
    EXPECT_NEAR(run.certificate.estimated_reach, 1, 0.05) << k;
  }
}

TEST(Certifier, DoesNotChangeWithTheUnit) {
  for (const double scale : {1e-6, 1.0, 1e6}) {
    HandmadeMesh mesh = Icosphere(2);
    for (double& x : mesh.points) x *= scale;
    const auto closest = [scale](const Eigen::VectorXd& x) -> Eigen::VectorXd {
      return scale * x.normalized();
    };
    const CertifiedRun run = Certify(SpecificationFor(mesh, 0.4 * scale), mesh, closest);
    EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
    EXPECT_NEAR(run.certificate.estimated_reach / scale, 1, 1e-6);
  }
}

TEST(Certifier, IsDeterministic) {
  const HandmadeMesh mesh = RevolutionGrid(48, 1, 0.35);
  const Specification spec = SpecificationFor(mesh, 0.1);
  const CertifiedRun a = Certify(spec, mesh, OnRevolution(1, 0.35));
  const CertifiedRun b = Certify(spec, mesh, OnRevolution(1, 0.35));
  EXPECT_EQ(a.queries, b.queries);
  EXPECT_EQ(a.certificate.estimated_reach, b.certificate.estimated_reach);
  EXPECT_EQ(a.certificate.max_barycentre_distance, b.certificate.max_barycentre_distance);
  EXPECT_EQ(a.certificate.fibre_samples, b.certificate.fibre_samples);
}

TEST(Certifier, AsksAboutAsMuchOfALargeMeshAsOfASmallOne) {
  const HandmadeMesh mesh = Icosphere(6);
  const CertifiedRun run = Certify(SpecificationFor(mesh, 0.03), mesh, ClosestOnSphere);
  EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
  // And a probe, with its differences, for 50 vertices.
  EXPECT_LE(run.queries, 3500 + 3 * mesh.vertices() / 50);
  EXPECT_LE(run.rounds, 2);
}

// Two barycentres a vertex, a quarter of the vertices, a ball on either side of an eighth of them;
// and some 300 others.
TEST(Certifier, AsksAboutASmallMeshByItsVertices) {
  for (const auto& [level, epsilon] : {std::pair{2, 0.4}, {3, 0.2}, {4, 0.1}}) {
    const HandmadeMesh mesh = Icosphere(level);
    const CertifiedRun run = Certify(SpecificationFor(mesh, epsilon), mesh, ClosestOnSphere);
    EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
    EXPECT_LE(run.queries, 300 + 2.5 * mesh.vertices()) << mesh.vertices();
    EXPECT_EQ(run.rounds, 1u) << "answers tell the normals";
  }
}

// Answers that are off tell no normals.
TEST(Certifier, TakesDifferencesWhereAnswersAreInexact) {
  const HandmadeMesh mesh = Icosphere(3);
  const auto noisy = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Random random(static_cast<std::uint64_t>(1e9 * (x[0] + 3 * x[1] + 7 * x[2])));
    return x.normalized() * (1 + 0.003 * (random.Uniform() - 0.5));
  };
  const CertifiedRun exact = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere);
  const CertifiedRun run = Certify(SpecificationFor(mesh, 0.2), mesh, noisy);
  EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
  EXPECT_GE(run.queries, exact.queries + 50);
}

// Components so small that a hundred probes of a large mesh mostly miss them.
TEST(Certifier, SeesSmallComponentsOfALargeMesh) {
  const HandmadeMesh mesh = Icosphere(6);
  int seen = 0;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d centre = 1.1 * Eigen::Vector3d(std::cos(i), std::sin(i), 0.3 * i - 0.7);
    const auto closest = TwoSpheres(1.1 * centre.normalized(), 0.06);
    seen += !Certify(SpecificationFor(mesh, 0.03), mesh, closest).certificate.certified;
  }
  EXPECT_GE(seen, 5);
}

TEST(Certifier, SaysOfACoarseMeshThatNothingContradictsIt) {
  const HandmadeMesh mesh = CrossPolytope(2);
  const Certificate c = Certify(SpecificationFor(mesh, 0.82), mesh, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(c.only_too_coarse) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "Nothing that was seen contradicts the mesh")) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "take epsilon at most 0.4")) << c.verdict;
  EXPECT_FALSE(Certify(SpecificationFor(Icosphere(3), 0.2), Icosphere(3), ClosestOnSphere)
                   .certificate.only_too_coarse);
}

TEST(Certifier, TakesTangentsThatRideAlong) {
  const HandmadeMesh mesh = Icosphere(3);
  Specification spec = SpecificationFor(mesh, 0.2);
  spec.oracle.tangent_basis = true;
  const CertifiedRun with = Certify(spec, mesh, ClosestOnSphere, {0, 0, true}, Complement);
  EXPECT_TRUE(with.certificate.certified) << with.certificate.verdict;
  spec.oracle.tangent_basis = false;
  const CertifiedRun without = Certify(spec, mesh, ClosestOnSphere);
  // Besides, only two steps at 64 vertices that compare them with closest points.
  EXPECT_LE(with.queries, without.queries + 128);
}

TEST(Certifier, ForgivesASmallErrorAndMentionsIt) {
  const HandmadeMesh mesh = Icosphere(3);
  const auto noisy = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Random random(static_cast<std::uint64_t>(1e9 * (x[0] + 3 * x[1] + 7 * x[2])));
    return x.normalized() * (1 + 0.001 * (random.Uniform() - 0.5));
  };
  const CertifiedRun run = Certify(SpecificationFor(mesh, 0.2), mesh, noisy);
  EXPECT_TRUE(run.certificate.certified) << run.certificate.verdict;
  ASSERT_EQ(run.certificate.warnings.size(), 1u);
  EXPECT_TRUE(Says(run.certificate.warnings[0], "tighter tolerance"));
}

TEST(Certifier, RefusesAMissingTriangle) {
  HandmadeMesh mesh = Icosphere(3);
  const std::vector<std::uint32_t> hole(&mesh.simplices[17 * 3], &mesh.simplices[18 * 3]);
  mesh.RemoveSimplex(17);
  const Certificate c = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_FALSE(c.closed);
  EXPECT_EQ(c.bad_faces, 3u);
  EXPECT_EQ(c.bad_links, 3u);
  EXPECT_EQ(c.unembedded_stars, 3u);
  EXPECT_EQ(c.violations.faces,
            (std::vector{hole[0], hole[1], hole[0], hole[2], hole[1], hole[2]}));
  EXPECT_EQ(c.violations.links, hole);
  EXPECT_EQ(c.violations.stars, hole);
  EXPECT_TRUE(Says(c.verdict, "not closed")) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "is in 1 simplex")) << c.verdict;
}

TEST(Certifier, RefusesAVertexWithoutSimplices) {
  HandmadeMesh mesh = Icosphere(3);
  const Eigen::Vector3d p(0.6, 0.64, 0.48);
  mesh.AddVertex(p, Complement(p));
  const Certificate c = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "is in no simplex")) << c.verdict;
  EXPECT_EQ(c.violations.links, std::vector{mesh.vertices() - 1});
}

TEST(Certifier, RefusesADoubledSheet) {
  HandmadeMesh mesh = Icosphere(3);
  mesh.Append(Icosphere(3));
  const Certificate c = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere).certificate;
  EXPECT_TRUE(c.links_are_spheres);
  EXPECT_EQ(c.components, 2u);
  EXPECT_FALSE(c.certified);
  EXPECT_EQ(c.fibre_failures, c.fibre_samples);
  EXPECT_EQ(c.violations.fibres.size(), Violations::kMost);
  EXPECT_TRUE(std::is_sorted(c.violations.fibres.begin(), c.violations.fibres.end()));
  EXPECT_TRUE(Says(c.verdict, "meets the mesh 2 times")) << c.verdict;
}

TEST(Certifier, RefusesAFold) {
  HandmadeMesh mesh = Icosphere(3);
  // Push vertex 100 over its neighbours along the sphere.
  std::uint32_t neighbour = 0;
  for (std::size_t s = 0; s < mesh.size(); ++s) {
    const std::uint32_t* t = &mesh.simplices[3 * s];
    if (std::find(t, t + 3, 100u) != t + 3) neighbour = t[0] == 100 ? t[1] : t[0];
  }
  const Eigen::VectorXd p =
      (mesh.Point(100) + 1.5 * (mesh.Point(neighbour) - mesh.Point(100))).normalized();
  const Eigen::MatrixXd tangent = Complement(p);
  for (int i = 0; i < 3; ++i) {
    mesh.points[300 + i] = p[i];
    for (int a = 0; a < 2; ++a) mesh.tangents[600 + 3 * a + i] = tangent(i, a);
  }
  const Certificate c = Certify(SpecificationFor(mesh, 0.6), mesh, ClosestOnSphere).certificate;
  EXPECT_TRUE(c.links_are_spheres);
  EXPECT_FALSE(c.certified);
  EXPECT_GT(c.unembedded_stars, 0u);
  EXPECT_TRUE(Says(c.verdict, "the star of vertex")) << c.verdict;
}

TEST(Certifier, RefusesAMissingComponent) {
  const HandmadeMesh mesh = Icosphere(3);
  const auto closest = TwoSpheres({5, 0, 0}, 1);
  Specification spec = SpecificationFor(mesh, 0.2);
  // The run began with a seed, not with points of the box.
  spec.seeds = Eigen::Vector3d(0, 0, 1.1);
  spec.bounding_box =
      BoundingBox{Eigen::Vector3d(-1.5, -1.5, -1.5), Eigen::Vector3d(6.5, 1.5, 1.5)};
  const Certificate by_box = Certify(spec, mesh, closest).certificate;
  EXPECT_FALSE(by_box.certified);
  EXPECT_TRUE(Says(by_box.verdict, "misses a part")) << by_box.verdict;
  EXPECT_FALSE(Says(by_box.verdict, "outside of the bounding box")) << by_box.verdict;

  // What the run began with is not asked again: its answers are known.
  KnownOfManifold known;
  known.points = {6, 0, 0};
  spec.bounding_box.reset();
  const Certificate by_seed =
      Certify(spec, mesh, closest, {0, 0, true}, nullptr, known).certificate;
  EXPECT_FALSE(by_seed.certified);
  EXPECT_TRUE(Says(by_seed.verdict, "misses a part")) << by_seed.verdict;

  spec.bounding_box = BoundingBox{Eigen::Vector3d::Constant(-2), Eigen::Vector3d::Constant(2)};
  const Certificate outside =
      Certify(spec, mesh, closest, {0, 0, true}, nullptr, known).certificate;
  EXPECT_TRUE(Says(outside.verdict,
                   "answers like it: 1; that point lies 4 outside of the "
                   "bounding box"))
      << outside.verdict;
}

TEST(Certifier, RefusesAMissingSheetNearby) {
  const HandmadeMesh mesh = Icosphere(3);
  const Certificate c =
      Certify(SpecificationFor(mesh, 0.2), mesh, TwoSpheres({0, 0, 0}, 1.25)).certificate;
  EXPECT_FALSE(c.certified);
}

TEST(Certifier, RefusesASphereThatStandsForATorus) {
  HandmadeMesh mesh = Icosphere(2);
  const auto closest = OnRevolution(1, 0.3);
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    const Eigen::VectorXd p = closest(mesh.Point(v) + Eigen::Vector3d(0.01, 0.02, 0));
    const Eigen::VectorXd ring = Eigen::Vector3d(p[0], p[1], 0).normalized();
    const Eigen::MatrixXd tangent = Complement((p - ring).normalized());
    for (int i = 0; i < 3; ++i) {
      mesh.points[3 * v + i] = p[i];
      for (int a = 0; a < 2; ++a) mesh.tangents[6 * v + 3 * a + i] = tangent(i, a);
    }
  }
  const Certificate c = Certify(SpecificationFor(mesh, 1.2), mesh, closest).certificate;
  EXPECT_TRUE(c.links_are_spheres);
  EXPECT_EQ(c.euler_characteristic, 2);
  EXPECT_FALSE(c.certified);
  EXPECT_FALSE(c.only_too_coarse) << c.verdict;
  EXPECT_GT(c.epsilon_over_reach, 3);
}

TEST(Certifier, RefusesVerticesOffTheManifold) {
  const HandmadeMesh mesh = Icosphere(3);
  const auto lying = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return 1.1 * x.normalized();
  };
  const Certificate c = Certify(SpecificationFor(mesh, 0.2), mesh, lying).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "is not on the manifold")) << c.verdict;
}

TEST(Certifier, RefusesAnOracleThatFindsNothing) {
  const HandmadeMesh mesh = Icosphere(3);
  const auto mute = [](const Eigen::VectorXd&) { return Eigen::VectorXd(); };
  const Certificate c = Certify(SpecificationFor(mesh, 0.2), mesh, mute).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "no closest point")) << c.verdict;
}

TEST(Certifier, RefusesSimplicesLargerThanEpsilon) {
  const HandmadeMesh mesh = Icosphere(3);
  const Certificate c = Certify(SpecificationFor(mesh, 0.05), mesh, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "more than epsilon = 0.05")) << c.verdict;
}

TEST(Certifier, RefusesWhatTheStarsSay) {
  const HandmadeMesh mesh = Icosphere(3);
  const Specification spec = SpecificationFor(mesh, 0.2);
  const Certificate inconsistent = Certify(spec, mesh, ClosestOnSphere, {3, 0, true}).certificate;
  EXPECT_FALSE(inconsistent.certified);
  EXPECT_TRUE(Says(inconsistent.verdict, "3 simplices are in the star")) << inconsistent.verdict;
  const Certificate unfinished = Certify(spec, mesh, ClosestOnSphere, {0, 0, false}).certificate;
  EXPECT_FALSE(unfinished.certified);
  EXPECT_TRUE(Says(unfinished.verdict, "rules still applied")) << unfinished.verdict;
  const Certificate large = Certify(spec, mesh, ClosestOnSphere, {0, 0.3, true}).certificate;
  EXPECT_FALSE(large.certified);
  EXPECT_EQ(large.max_circumradius, 0.3);
}

TEST(Certifier, RefusesMalformedMeshesWithoutAsking) {
  HandmadeMesh mesh = Icosphere(3);
  mesh.simplices[5] = 100000;
  const CertifiedRun bad_id = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere);
  EXPECT_FALSE(bad_id.certificate.certified);
  EXPECT_EQ(bad_id.rounds, 0);
  EXPECT_TRUE(Says(bad_id.certificate.verdict, "100000")) << bad_id.certificate.verdict;

  mesh.simplices.clear();
  const CertifiedRun empty = Certify(SpecificationFor(mesh, 0.2), mesh, ClosestOnSphere);
  EXPECT_FALSE(empty.certificate.certified);
  EXPECT_EQ(empty.rounds, 0);
}

}  // namespace
}  // namespace stellate::core
