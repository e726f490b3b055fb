#include "core/certificate/measure/shape.h"

#include <gtest/gtest.h>

#include "core/base/random.h"
#include "core/certificate/measure/star_geometry.h"
#include "core/geometry/simplex.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

// With vertices moved at random.
HandmadeMesh Shaken(HandmadeMesh mesh, double by) {
  Random random(11);
  for (double& x : mesh.points) x += by * random.NearlyNormal();
  return mesh;
}

// The same in R^d, behind zeros.
HandmadeMesh Lifted(const HandmadeMesh& mesh, int d) {
  HandmadeMesh lifted;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    Eigen::VectorXd p = Eigen::VectorXd::Zero(d);
    Eigen::MatrixXd tangent = Eigen::MatrixXd::Zero(d, mesh.k);
    p.tail(mesh.d) = mesh.Point(v);
    tangent.bottomRows(mesh.d) =
        Eigen::Map<const Eigen::MatrixXd>(mesh.View().Tangent(v), mesh.d, mesh.k);
    lifted.AddVertex(p, tangent);
  }
  lifted.simplices = mesh.simplices;
  return lifted;
}

MeshShape ShapeOf(const HandmadeMesh& mesh) {
  return MeasureStars(mesh.View(), Adjacency(mesh.List())).shape;
}

TEST(MeasureShape, FindsTheExtremesOfAllSimplices) {
  const std::vector<HandmadeMesh> meshes{Shaken(TorusGrid(1, 30, CliffordPoint), 0.05),
                                         Shaken(Icosphere(3), 0.03),
                                         Shaken(TorusGrid(2, 12, CliffordPoint), 0.05),
                                         Shaken(TorusGrid(3, 6, CliffordPoint), 0.1),
                                         Shaken(SimplexBoundary(3), 0.1),
                                         Shaken(SimplexBoundary(5), 0.1),
                                         Shaken(TorusGrid(4, 3, CliffordPoint), 0.1),
                                         Lifted(Shaken(Icosphere(2), 0.03), 13),
                                         Lifted(Shaken(TorusGrid(3, 5, CliffordPoint), 0.1), 14)};
  for (const HandmadeMesh& mesh : meshes) {
    const int k = mesh.k, d = mesh.d;
    const MeshShape shape = ShapeOf(mesh);
    MeshShape direct;
    double angle = k == 2 ? std::numbers::pi : 0, tangent_angle = 0;
    for (std::uint32_t s = 0; s < mesh.size(); ++s) {
      std::vector<const double*> corners;
      for (int i = 0; i <= k; ++i) corners.push_back(mesh.View().Point(mesh.List()[s][i]));
      const SimplexMeasures m = MeasureSimplex(corners, d);
      direct.max_circumradius = std::max(direct.max_circumradius, m.circumradius);
      direct.max_diameter = std::max(direct.max_diameter, m.diameter);
      direct.max_radius_edge = std::max(direct.max_radius_edge, m.RadiusEdgeRatio());
      direct.min_fatness = std::min(direct.min_fatness, m.Fatness());
      if (k == 2) angle = std::min(angle, SmallestTriangleAngle(corners, d));
      double tilt = 0;
      for (int i = 0; i <= k; ++i) {
        const double* tangent = mesh.View().Tangent(mesh.List()[s][i]);
        tangent_angle = std::max(tangent_angle, AngleToTangent(corners, d, tangent, k));
        tilt = std::max(tilt, MeasureTilt(FrameSimplex(corners, d), k, d, tangent, k).trace());
      }
      EXPECT_NEAR(shape.diameters[s], m.diameter, 1e-6 * m.diameter);
      EXPECT_NEAR(shape.tilts[s], tilt, 1e-6);
      if (s == shape.largest) {
        EXPECT_NEAR(m.circumradius, shape.max_circumradius, 1e-12 * m.circumradius);
      }
    }
    constexpr double kDegrees = 180 / std::numbers::pi;
    EXPECT_NEAR(shape.max_circumradius, direct.max_circumradius, 1e-10 * direct.max_circumradius);
    EXPECT_NEAR(shape.max_diameter, direct.max_diameter, 1e-13);
    EXPECT_NEAR(shape.max_radius_edge, direct.max_radius_edge, 1e-10 * direct.max_radius_edge);
    EXPECT_NEAR(shape.min_fatness, direct.min_fatness, 1e-12);
    EXPECT_NEAR(shape.min_angle_degrees, angle * kDegrees, 1e-10) << k << " " << d;
    EXPECT_NEAR(shape.max_tangent_angle_degrees, tangent_angle * kDegrees, 1e-9) << k << " " << d;
  }
}

TEST(MeasureShape, ADegenerateSimplexIsAtARightAngle) {
  HandmadeMesh mesh = Icosphere(1);
  std::copy_n(&mesh.points[0], 3, &mesh.points[3 * mesh.simplices[1]]);
  std::copy_n(&mesh.points[0], 3, &mesh.points[3 * mesh.simplices[2]]);
  const MeshShape shape = ShapeOf(mesh);
  EXPECT_EQ(shape.min_fatness, 0);
  EXPECT_EQ(shape.min_angle_degrees, 0);
  EXPECT_TRUE(std::isinf(shape.max_radius_edge));
  EXPECT_NEAR(shape.max_tangent_angle_degrees, 90, 1e-12);
}

}  // namespace
}  // namespace stellate::core
