// What a mesh came to, on the disk.

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "server/records/journal_format.h"

namespace stellate::server {
namespace {

SessionResult Refused() {
  SessionResult result;
  result.revision = 9;
  result.report.certificate.verdict = "Not certified";
  result.report.certificate.violations.faces = {1, 2, 1, 5};
  result.report.certificate.violations.stars = {3, 8};
  for (const std::uint64_t revision : {4, 9}) {
    PastProgress past;
    past.revision = revision;
    past.progress.bad_size = 10 * revision;
    past.elapsed_seconds = 0.5;
    result.past.Add(past);
  }
  return result;
}

TEST(ResultRecord, HoldsWhereAMeshIsAtFaultAndHowItStood) {
  std::uint64_t parts = 0;
  const auto read = DecodeResult(EncodeResult(Refused(), 2), &parts);
  ASSERT_TRUE(read);
  EXPECT_EQ(parts, 2u);
  const core::Violations& violations = read->report.certificate.violations;
  EXPECT_EQ(violations.faces, (std::vector<std::uint32_t>{1, 2, 1, 5}));
  EXPECT_TRUE(violations.links.empty());
  EXPECT_EQ(violations.stars, (std::vector<std::uint32_t>{3, 8}));
  ASSERT_EQ(read->past.all().size(), 2u);
  EXPECT_EQ(read->past.all()[0].revision, 4u);
  EXPECT_EQ(read->past.all()[1].progress.bad_size, 90u);
  EXPECT_EQ(read->past.all()[1].elapsed_seconds, 0.5);
}

TEST(ResultRecord, HoldsFacesAndWhereWallsMeetMostSharply) {
  SessionResult result = Refused();
  core::Certificate& certificate = result.report.certificate;
  certificate.faces = {{core::WallSet{5}, 1, 7, 2, -3, {0, 1}, 2.5, {2, 1}}};
  certificate.regions = {{4, 9, 1, 1, 0.25, 12, {1, 0, 0}}};
  certificate.pinched_vertices = 3;
  certificate.volume = 0.25;
  certificate.betti = {1, 4, 1};
  certificate.sharpest = core::WallAngle{core::WallSet{5}, 27.5, Eigen::Vector3d(1, 2, 3)};
  std::uint64_t parts = 0;
  const auto read = DecodeResult(EncodeResult(result, 2), &parts);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->report.certificate.faces.size(), 1u);
  EXPECT_EQ(read->report.certificate.faces[0].euler_characteristic, -3);
  EXPECT_EQ(read->report.certificate.faces[0].volume, 2.5);
  EXPECT_EQ(read->report.certificate.faces[0].betti, (std::vector<std::int64_t>{2, 1}));
  ASSERT_EQ(read->report.certificate.regions.size(), 1u);
  EXPECT_EQ(read->report.certificate.regions[0].volume, 0.25);
  EXPECT_EQ(read->report.certificate.regions[0].min_dihedral_degrees, 12);
  EXPECT_EQ(read->report.certificate.pinched_vertices, 3u);
  EXPECT_EQ(read->report.certificate.regions[0].betti, (std::vector<std::int64_t>{1, 0, 0}));
  EXPECT_EQ(read->report.certificate.volume, 0.25);
  EXPECT_EQ(read->report.certificate.betti, (std::vector<std::int64_t>{1, 4, 1}));
  ASSERT_TRUE(read->report.certificate.sharpest);
  EXPECT_EQ(read->report.certificate.sharpest->walls, core::WallSet{5});
  EXPECT_EQ(read->report.certificate.sharpest->degrees, 27.5);
  EXPECT_EQ(read->report.certificate.sharpest->point, Eigen::Vector3d(1, 2, 3));
}

TEST(ResultRecord, KeepsWhatBecameOfPoints) {
  SessionResult result = Refused();
  core::ReconstructionCounts& counts = result.report.reconstruction.emplace();
  counts.places[0] = 90;
  counts.places[10] = 7;
  counts.places[11] = 2;
  counts.noise_ratio = 0.25;
  counts.smoothed = true;
  counts.looks[0] = 0.5;
  counts.unfilled_vertices = 3;
  std::uint64_t parts = 0;
  const auto read = DecodeResult(EncodeResult(result, 2), &parts);
  ASSERT_TRUE(read && read->report.reconstruction);
  const core::ReconstructionCounts& back = *read->report.reconstruction;
  EXPECT_EQ(back.places[0], 90u);
  EXPECT_EQ(back.places[10], 7u);
  EXPECT_EQ(back.places[11], 2u);
  EXPECT_EQ(back.noise_ratio, 0.25);
  EXPECT_TRUE(back.smoothed);
  EXPECT_EQ(back.looks[0], 0.5);
  EXPECT_EQ(back.unfilled_vertices, 3u);
}

TEST(ResultRecord, KeepsProtection) {
  SessionResult result = Refused();
  result.progress.bad_protection = 4;
  result.report.counts.inserted_protection = 5;
  result.report.certificate.protection =
      core::ProtectionReport{1, 2, 3, 4, 5, 6, {7, 8, 9}, 10, 11, true};
  std::uint64_t parts = 0;
  const auto read = DecodeResult(EncodeResult(result, 2), &parts);
  ASSERT_TRUE(read && read->report.certificate.protection);
  EXPECT_EQ(read->progress.bad_protection, 4u);
  EXPECT_EQ(read->report.counts.inserted_protection, 5u);
  const core::ProtectionReport& back = *read->report.certificate.protection;
  EXPECT_EQ((std::vector{back.asked, back.least, back.percentile, back.median, back.least_ratio,
                         back.stability_radius, back.thickness_bound}),
            (std::vector<double>{1, 2, 3, 4, 5, 10, 11}));
  EXPECT_EQ(back.weak, 6u);
  EXPECT_EQ(back.worst, (std::vector<std::uint32_t>{7, 8, 9}));
  EXPECT_TRUE(back.is_delaunay);
}

// Those of earlier servers end before the boundary, or behind it, the past, the angle or the mark
// of a mesh that is too coarse; what ends elsewhere is damaged.
TEST(ResultRecord, EarlierOnesAreRead) {
  SessionResult result = Refused();
  result.report.certificate.only_too_coarse = true;
  const std::string record = EncodeResult(result, 2);
  std::vector<std::size_t> whole;
  for (std::size_t bytes = 0; bytes <= record.size(); ++bytes) {
    std::uint64_t parts = 0;
    const auto read = DecodeResult(std::string_view(record).substr(0, bytes), &parts);
    if (!read) continue;
    whole.push_back(bytes);
    EXPECT_EQ(parts, 2u);
    EXPECT_EQ(read->revision, 9u);
    EXPECT_EQ(read->report.certificate.verdict, "Not certified");
    EXPECT_EQ(read->past.all().empty(), whole.size() <= 2);
    EXPECT_EQ(read->report.certificate.violations.stars.empty(), whole.size() <= 2);
    EXPECT_EQ(read->report.certificate.only_too_coarse, whole.size() >= 5);
  }
  ASSERT_EQ(whole.size(), 8u);
  EXPECT_EQ(whole.back(), record.size());
}

}  // namespace
}  // namespace stellate::server
