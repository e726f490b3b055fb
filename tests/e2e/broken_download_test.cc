// Downloads that break off, or make no sense.

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "scattered_download.h"
#include "stellate/mesh.h"

namespace stellate::testing {
namespace {

TEST_F(BrokenDownload, GoesOnWhereItWas) {
  fake_.breaks = {4, 0, 5};
  const Expected<Mesh> mesh = Fetch();
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  using Asked = std::vector<std::pair<std::uint64_t, std::uint64_t>>;
  EXPECT_EQ(fake_.asked, (Asked{{0, 0}, {7, 4}, {7, 4}, {7, 9}}));
  EXPECT_EQ(outages_, 2);  // gRPC itself repeats the call that brought nothing
  ASSERT_EQ(mesh->points.cols(), 6);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(mesh->points.col(i), Eigen::Vector2d(i, 0.5));
  SimplexMatrix cells(2, 6);
  cells << 0, 0, 1, 2, 3, 4,  //
      1, 5, 2, 3, 4, 5;
  EXPECT_EQ(mesh->simplices, cells);
  EXPECT_EQ(mesh->report.termination, Termination::kConverged);
}

TEST_F(BrokenDownload, IsNotResumedWhereThatIsOfNoUse) {
  options_.connection.reconnect = Seconds(0);
  fake_.breaks = {4};
  Expected<Mesh> mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed);
  EXPECT_NE(mesh.error().message.find("broken by the test"), std::string::npos);
  options_.connection.reconnect = Seconds(60);
  fake_.breaks = {4};
  fake_.with = {grpc::StatusCode::RESOURCE_EXHAUSTED, "too many"};
  mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kRefused);
  EXPECT_EQ(fake_.asked.size(), 2u);
}

TEST_F(BrokenDownload, EndsWhenItIsStopped) {
  std::stop_source source;
  options_.stop = source.get_token();
  options_.on_part = [&source](auto, auto) { source.request_stop(); };
  fake_.breaks = {4};
  const Expected<Mesh> mesh = Fetch();
  ASSERT_FALSE(mesh.has_value());
  EXPECT_EQ(mesh.error().code, ErrorCode::kStopped);
}

TEST_F(BrokenDownload, PartsThatDoNotFitAreTheServersFault) {
  const std::vector<std::function<void(v1::DownloadMeshResponse*)>> faults = {
      [](auto* part) { part->set_first_vertex(part->first_vertex() + 1); },
      [](auto* part) { part->set_simplices(8); }, [](auto* part) { part->set_complete(false); },
      [](auto* part) { part->mutable_points()->set_data("short"); },
      [](auto* part) {
        const std::uint32_t cell[] = {0, 9};
        if (part->complete()) part->mutable_cells()->set_data(cell, sizeof cell);
      }};
  for (const auto& fault : faults) {
    fake_.spoil = fault;
    const Expected<Mesh> mesh = Fetch();
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().code, ErrorCode::kServerFailed) << mesh.error().message;
  }
}

}  // namespace
}  // namespace stellate::testing
