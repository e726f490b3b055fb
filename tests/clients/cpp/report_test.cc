#include "stellate/report.h"

#include <gtest/gtest.h>

#include <limits>

namespace stellate {
namespace {

Report Good() {
  Report report;
  report.termination = Termination::kConverged;
  report.counts.vertices = 1234567;
  report.counts.simplices = 42;
  report.certificate.certified = true;
  report.certificate.verdict = "every check holds";
  report.certificate.components = 1;
  report.certificate.euler_characteristic = -8;
  return report;
}

TEST(ReportJson, EscapesTextAndWritesNullForWhatJsonLacks) {
  Report report = Good();
  report.failure_reason = "ORACLE_FAILED";
  report.failure_message = "a \"quote\", a \\ and a\nnew line";
  report.certificate.estimated_reach = std::numeric_limits<double>::infinity();
  const std::string json = ToJson(report);
  EXPECT_EQ(json.rfind("{\"termination\": \"CONVERGED\", \"failure\": {", 0), 0u) << json;
  EXPECT_NE(json.find(R"("a \"quote\", a \\ and a\u000anew line")"), std::string::npos) << json;
  EXPECT_NE(json.find("\"estimated_reach\": null"), std::string::npos) << json;
  EXPECT_NE(json.find("\"euler_characteristic\": -8"), std::string::npos) << json;
  EXPECT_NE(json.find("\"vertices\": 1234567"), std::string::npos) << json;
  EXPECT_EQ(json.find('\n'), std::string::npos);
}

// What the Python client writes of the same report: see test_progress.py.
TEST(ReportJson, IsThatOfAllClients) {
  Report report;
  report.termination = Termination::kOracleFailed;
  report.failure_reason = "ORACLE_RAISED";
  report.failure_message = "a \"quote\"";
  report.epsilon = 0.1;
  report.elapsed_seconds = 0.5;
  report.counts.vertices = 1234567;
  report.counts.simplices = 42;
  report.certificate.verdict = "3 links";
  report.certificate.warnings = {"coarse", "dear"};
  report.certificate.bad_links = 3;
  report.certificate.violations.faces = {{1, 2}, {1, 5}};
  report.certificate.violations.stars = {7};
  report.certificate.violations.fibres = {0, 3};
  report.certificate.max_circumradius = 0.25;
  report.certificate.estimated_reach = std::numeric_limits<double>::infinity();
  report.certificate.components = 1;
  report.certificate.euler_characteristic = -8;
  report.certificate.betti = {1, 10};
  EXPECT_EQ(
      ToJson(report),
      R"({"termination": "ORACLE_FAILED", "failure": {"reason": "ORACLE_RAISED", "message": )"
      R"("a \"quote\""}, "epsilon": 0.10000000000000001, "epsilon_reason": "", "counts": )"
      R"({"vertices": 1234567, "simplices": 42, "rounds": 0, "queries": 0, "tangent_queries": 0, )"
      R"("inserted_size": 0, "inserted_radius_edge": 0, "inserted_sliver": 0, )"
      R"("inserted_inconsistent": 0, "inserted_protection": 0, "duplicates": 0}, )"
      R"("certificate": {"certified": false, )"
      R"("verdict": "3 links", "warnings": ["coarse", "dear"], "closed": false, "bad_faces": 0, )"
      R"("links_are_spheres": false, "links_decided_exactly": false, "bad_links": 3, )"
      R"("inconsistent_simplices": 0, "unembedded_stars": 0, "fibre_failures": 0, )"
      R"("fibre_samples": 0, "max_circumradius": 0.25, "max_radius_edge": 0, "min_fatness": 0, )"
      R"("min_angle_degrees": 0, "max_tangent_angle_degrees": 0, "max_barycentre_distance": 0, )"
      R"("estimated_reach": null, "epsilon_over_reach": 0, "components": 1, )"
      R"("euler_characteristic": -8, "orientable": false, "level": "UNKNOWN", )"
      R"("declared_reach": 0, "reach_refuted": false, "proved_distance": 0, "answers_checked": 0, )"
      R"("violations": {"faces": [[1, 2], [1, 5]], "links": [], "stars": [7], )"
      R"("inconsistent": [], "fibres": [0, 3]}, "boundary_simplices": 0, )"
      R"("boundary_components": 0, "boundary_euler_characteristic": 0, "faces": [], )"
      R"("sharpest": null, "regions": [], "pinched_vertices": 0, "volume": 0, "only_too_coarse": false, )"
      R"("protection": null, "betti": [1, 10]}, )"
      R"("elapsed_seconds": 0.5, )"
      R"("version": "0.2.0"})");
  report.epsilon = 0;
  EXPECT_NE(ToJson(report).find("\"epsilon\": null"), std::string::npos);
}

}  // namespace
}  // namespace stellate
