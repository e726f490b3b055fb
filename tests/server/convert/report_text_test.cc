#include "server/convert/report_text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <sstream>

#include "core/report.h"
#include "server/convert/mesh.h"

namespace stellate::server {
namespace {

v1::Report Good() {
  v1::Report report;
  report.set_termination(v1::TERMINATION_CONVERGED);
  report.set_elapsed_seconds(0.5);
  report.mutable_counts()->set_vertices(1234567);
  report.mutable_counts()->set_simplices(42);
  report.mutable_counts()->set_queries(1000);
  v1::Certificate& c = *report.mutable_certificate();
  c.set_certified(true);
  c.set_level(v1::CERTIFICATE_LEVEL_SAMPLED);
  c.set_verdict("Certified: every check holds.");
  c.set_closed(true);
  c.set_links_are_spheres(true);
  c.set_components(1);
  c.set_fibre_samples(240);
  c.set_euler_characteristic(-8);
  c.set_max_circumradius(0.123456);
  c.set_min_angle_degrees(20.26);
  c.set_estimated_reach(std::numeric_limits<double>::infinity());
  return report;
}

bool Says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

TEST(ReportText, IsAsAllClientsShowIt) {
  EXPECT_EQ(ReportText(Good(), 2), R"(         mesh  1,234,567 vertices, 42 simplices
          run  converged: no refinement rule applies any more
         took  0.50 s, 0 round trips, 1,000 queries
 inserted for  size 0, radius-edge 0, slivers 0, inconsistencies 0
  certificate  CERTIFIED: every check holds.
     topology  1 component, Euler characteristic -8, not orientable
     manifold  closed; every link a sphere (decided by homology)
        stars  0 inconsistent simplices, 0 stars overlap, 0 of 240 normal flats met wrongly
        shape  largest circumradius 0.1235, radius-edge ratio 0; smallest fatness 0, angle 20.3
               degrees
    closeness  barycentres within 0 of the manifold, simplices within 0.0 degrees of its tangent
               spaces
        reach  about inf, epsilon is 0 of it
)");
}

TEST(ReportText, NamesBettiNumbersWhereTheyAreKnown) {
  v1::Report report = Good();
  for (const std::int64_t number : {1, 10, 1}) report.mutable_certificate()->add_betti(number);
  EXPECT_TRUE(Says(ReportText(report, 2), "not orientable, Betti numbers 1 10 1\n"))
      << ReportText(report, 2);
}

TEST(ReportText, MeasuresAndSaysHowFarThatIsOff) {
  v1::Report report = Good();
  v1::Certificate& c = *report.mutable_certificate();
  c.set_volume(12.37);
  EXPECT_TRUE(Says(ReportText(report, 2), "      measure  area 12.37\n"));
  c.set_epsilon_over_reach(0.2);
  EXPECT_TRUE(
      Says(ReportText(report, 2), "area 12.37, off by O(epsilon^2): a share of about 0.04\n"));
  EXPECT_TRUE(Says(ReportText(report, 4), "4-volume 12.37, off"));
  c.set_certified(false);  // the reach is then no more than a bound
  EXPECT_TRUE(Says(ReportText(report, 1), "length 12.37\n"));
}

TEST(ReportText, SaysOfPointsWhatWasMeasuredAlone) {
  v1::Report report = Good();
  report.mutable_reconstruction()->set_spacing(0.5);
  report.mutable_certificate()->set_fibre_samples(0);
  report.mutable_certificate()->set_epsilon_over_reach(0.25);
  const std::string text = ReportText(report, 2);
  EXPECT_TRUE(Says(text, "0 stars overlap\n")) << text;
  EXPECT_FALSE(Says(text, "normal flats")) << text;
  EXPECT_FALSE(Says(text, "barycentres")) << text;
  EXPECT_TRUE(Says(text, "the largest circumradius is 0.25 of it")) << text;
}

TEST(ReportText, SaysThatAManifoldEnds) {
  v1::Report report = Good();
  report.mutable_certificate()->add_faces()->add_walls(0);
  EXPECT_TRUE(
      Says(ReportText(report, 2), "closed up to its boundary; every link a sphere or a ball "));
}

TEST(ReportText, NamesRegionsAndTellsWhereTheyTouchThemselves) {
  v1::Report report = Good();
  for (const std::uint32_t label : {1u, 2u}) {
    v1::RegionCertificate* const region = report.mutable_certificate()->add_regions();
    region->set_label(label);
    region->set_simplices(1000 * label);
    region->set_volume(0.5);
  }
  v1::FaceCertificate* const face = report.mutable_certificate()->add_faces();
  face->add_walls(6);
  face->set_label_below(1);
  face->set_label_above(2);
  report.mutable_certificate()->set_pinched_vertices(12);
  report.mutable_certificate()->set_links_are_spheres(true);
  const std::string text = ReportText(report, 2, {"", "grain"});
  EXPECT_TRUE(Says(text, "region  label 1: 1,000 simplices, volume 0.5"));
  EXPECT_TRUE(Says(text, "region  label 2 (grain): 2,000 simplices, volume 0.5"));
  EXPECT_TRUE(Says(text, "interface  wall 6, between 1 and 2 (grain): "));
  EXPECT_TRUE(Says(text, "where it is pinched, of each part alone"));
  EXPECT_TRUE(Says(text, "pinched  at 12 vertices, where the manifold or a region touches itself"));
}

TEST(ReportText, SaysWhetherItIsCertified) {
  v1::Report report = Good();
  v1::Certificate& c = *report.mutable_certificate();
  c.set_level(v1::CERTIFICATE_LEVEL_PROVED);
  c.set_verdict("Proved: by a theorem.");
  c.set_declared_reach(0.5);
  c.set_proved_distance(0.01);
  EXPECT_TRUE(Says(ReportText(report, 2), "certificate  PROVED: by a theorem."));
  EXPECT_TRUE(Says(ReportText(report, 2), "a reach of 0.5: within 0.01 of the manifold, proved"));
  c.set_certified(false);
  c.set_level(v1::CERTIFICATE_LEVEL_REFUSED);
  c.set_reach_refuted(true);
  c.set_verdict("Not certified: 3 links.");
  c.add_warnings("epsilon is coarse");
  const std::string bad = ReportText(report, 2);
  EXPECT_TRUE(Says(bad, "certificate  NOT CERTIFIED: 3 links.\n")) << bad;
  EXPECT_TRUE(Says(bad, "a reach of 0.5, refuted\n")) << bad;
  EXPECT_TRUE(Says(bad, "at most inf, epsilon is 0 of it or more\n")) << bad;
  EXPECT_TRUE(bad.ends_with("      warning  epsilon is coarse\n")) << bad;
  c.set_verdict("");
  EXPECT_TRUE(Says(ReportText(report, 2), "certificate  NOT CERTIFIED\n"));
}

TEST(ReportText, LeavesOutTheTopologyOfNothing) {
  v1::Report report = Good();
  report.mutable_certificate()->set_components(0);
  EXPECT_FALSE(Says(ReportText(report, 2), "topology"));
}

TEST(ReportText, FoldsLongLinesUnderTheirWords) {
  v1::Report report = Good();
  std::string verdict, long_word(120, 'x');
  for (int i = 0; i < 60; ++i) verdict += "word ";
  report.mutable_certificate()->set_verdict(verdict + long_word + " end");
  std::istringstream lines(ReportText(report, 2));
  int folded = 0;
  for (std::string line; std::getline(lines, line);) {
    if (Says(line, long_word)) {
      EXPECT_EQ(line, std::string(15, ' ') + long_word);
      continue;
    }
    EXPECT_LE(line.size(), 100u) << line;
    folded += line.starts_with(std::string(15, ' ') + "word word");
  }
  EXPECT_GE(folded, 3);
}

TEST(ReportText, SaysHowWellAMeshIsProtected) {
  v1::Report report = Good();
  EXPECT_FALSE(Says(ReportText(report, 2), "protection"));
  report.mutable_counts()->set_inserted_protection(7);
  v1::Protection& p = *report.mutable_certificate()->mutable_protection();
  p.set_asked(0.01);
  p.set_least(0.0101);
  p.set_percentile(0.02);
  p.set_median(0.06);
  p.set_stability_radius(0.0005);
  p.set_thickness_bound(0.009);
  std::string text = ReportText(report, 2);
  EXPECT_TRUE(Says(text, ", protection 7")) << text;
  EXPECT_TRUE(Says(text, "protection  0.01 asked, reached: gaps from 0.0101")) << text;
  EXPECT_TRUE(Says(text, "vertices move by less than 0.0005")) << text;
  EXPECT_FALSE(Says(text, "intrinsic")) << text;
  p.set_is_delaunay(true);
  p.set_weak(1);
  text = ReportText(report, 2);
  EXPECT_TRUE(Says(text, "not reached by 1 simplex:")) << text;
  EXPECT_TRUE(Says(text, "intrinsic, restricted and tangential")) << text;
}

// What a worker or an oracle says can neither command a terminal nor pass for another entry.
TEST(ReportText, ShowsNoCommandOfStrangers) {
  v1::Report report = Good();
  report.set_termination(v1::TERMINATION_ORACLE_FAILED);
  report.mutable_failure()->set_reason("ORACLE_FAILED");
  report.mutable_failure()->set_message("line 1\n  certificate  CERTIFIED\x1b[2J\r\u202e");
  report.mutable_certificate()->set_verdict("\x1b]0;title\x07");
  report.mutable_certificate()->add_warnings("one\ntwo\xff");
  const std::string text = ReportText(report, 2);
  EXPECT_TRUE(Says(text,
                   "      failure  ORACLE_FAILED: line 1\n"
                   "                 certificate  CERTIFIED?[2J??\n"))
      << text;
  EXPECT_TRUE(Says(text, "certificate  CERTIFIED: ?]0;title?\n")) << text;
  EXPECT_TRUE(Says(text, "      warning  one\n               two?\n")) << text;
  EXPECT_TRUE(
      std::ranges::all_of(text, [](char c) { return c == '\n' || (c >= ' ' && c < 0x7f); }));
}

TEST(ReportText, NamesEveryTermination) {
  for (int i = 1; i < v1::Termination_ARRAYSIZE; ++i) {
    v1::Report report;
    report.set_termination(static_cast<v1::Termination>(i));
    EXPECT_FALSE(Says(ReportText(report, 2), "unknown")) << i;
  }
}

}  // namespace
}  // namespace stellate::server
