// The table of `stellate top`: what it shows, in which order, in how much room.
#include "top_table.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace stellate::cli {
namespace {

MeshStatus Mesh(const std::string& name, const std::string& label, MeshState state,
                std::uint64_t vertices, double elapsed) {
  MeshStatus mesh;
  mesh.name = "meshes/" + name;
  mesh.label = label;
  mesh.state = state;
  mesh.progress.phase = Phase::kRefining;
  mesh.progress.vertices = vertices;
  mesh.progress.simplices = 2 * vertices;
  mesh.progress.round = 7;
  mesh.progress.elapsed_seconds = elapsed;
  mesh.progress.remaining_seconds = 30;
  mesh.workers = 2;
  mesh.watchers = 1;
  return mesh;
}

std::vector<MeshStatus> Four() {
  return {Mesh("0123456789", "done", MeshState::kSucceeded, 900, 400),
          Mesh("aaaaaaaaaa", "waits", MeshState::kWaiting, 0, 9),
          Mesh("bbbbbbbbbb", "young", MeshState::kRunning, 100, 2),
          Mesh("cccccccccc", "old", MeshState::kRunning, 5000, 100)};
}

// The labels of the meshes' lines, top to bottom.
std::vector<std::string> Labels(const TopTable& table) {
  std::vector<std::string> labels;
  const std::vector<std::string> lines = table.Lines(0, 0);
  for (size_t i = 2; i < lines.size(); ++i) {
    labels.push_back(lines[i].substr(9, lines[i].find(' ', 9) - 9));
  }
  return labels;
}

TEST(TopTable, ShowsEachMeshWithItsNumbers) {
  TopTable table(TopOrder::kState);
  table.Update(Four(), 10);
  const std::vector<std::string> lines = table.Lines(0, 0);
  ASSERT_EQ(lines.size(), 6u);
  EXPECT_EQ(lines[0], "4 meshes: 2 running, 1 waiting; 8 workers, 4 watchers; 6000 vertices");
  EXPECT_EQ(lines[1].rfind("MESH ", 0), 0u);
  EXPECT_EQ(lines[2],
            "cccccccc old   RUNNING   refining        7       5000      10000        50       2"
            "        1    1m40s    30.0s");
  EXPECT_EQ(lines[5].find("cccc"), std::string::npos);
  EXPECT_NE(lines[5].find("SUCCEEDED -"), std::string::npos);
  for (const std::string& line : lines) EXPECT_EQ(line.find("0123456789"), std::string::npos);
}

TEST(TopTable, SortsAsAsked) {
  using V = std::vector<std::string>;
  const std::pair<TopOrder, V> cases[] = {{TopOrder::kState, {"old", "young", "waits", "done"}},
                                          {TopOrder::kAge, {"done", "old", "waits", "young"}},
                                          {TopOrder::kVertices, {"old", "done", "young", "waits"}},
                                          {TopOrder::kRate, {"old", "young", "waits", "done"}},
                                          {TopOrder::kLabel, {"done", "old", "waits", "young"}}};
  for (const auto& [order, expected] : cases) {
    TopTable table(order);
    table.Update(Four(), 0);
    EXPECT_EQ(Labels(table), expected) << static_cast<int>(order);
  }
}

TEST(TopTable, SpeedIsThatSinceTheLastLook) {
  TopTable table(TopOrder::kState);
  table.Update({Mesh("a", "x", MeshState::kRunning, 1000, 10)}, 5);
  EXPECT_NE(table.Lines(0, 0)[2].find(" 100 "), std::string::npos) << table.Lines(0, 0)[2];
  table.Update({Mesh("a", "x", MeshState::kRunning, 1600, 12)}, 7);
  EXPECT_NE(table.Lines(0, 0)[2].find(" 300 "), std::string::npos) << table.Lines(0, 0)[2];
  // A server that replays after a restart starts over.
  table.Update({Mesh("a", "x", MeshState::kRunning, 10, 0.1)}, 8);
  EXPECT_NE(table.Lines(0, 0)[2].find(" 0 "), std::string::npos) << table.Lines(0, 0)[2];
}

TEST(TopTable, KeepsToItsRoom) {
  std::vector<MeshStatus> many;
  for (int i = 0; i < 50; ++i) {
    many.push_back(Mesh(std::to_string(i), std::string(120, 'x'), MeshState::kRunning, 1, 1));
  }
  TopTable table(TopOrder::kState);
  table.Update(many, 0);
  for (const int width : {10, 40, 100, 132}) {
    for (const int height : {1, 2, 3, 10, 60}) {
      const std::vector<std::string> lines = table.Lines(width, height);
      EXPECT_LE(lines.size(), static_cast<size_t>(std::max(2, height)));
      for (const std::string& line : lines) EXPECT_LE(line.size(), static_cast<size_t>(width));
    }
  }
  EXPECT_EQ(table.Lines(132, 10).back(), "... and 43 more");
  EXPECT_EQ(table.Lines(132, 60).size(), 52u);
}

TEST(TopTable, SaysWhoseAMeshIsWhereItIsTold) {
  MeshStatus mesh = Mesh("0123456789", "torus", MeshState::kRunning, 900, 400);
  TopTable table(TopOrder::kState);
  table.Update({mesh}, 0);
  EXPECT_EQ(table.Lines(0, 0)[2].find(" of "), std::string::npos);
  mesh.owner = "ada";
  table.Update({mesh}, 1);
  EXPECT_EQ(table.Lines(0, 0)[2].rfind("01234567 torus of ada ", 0), 0u) << table.Lines(0, 0)[2];
}

TEST(Tame, KeepsStrangersFromTheTerminal) {
  EXPECT_EQ(Tame("a\033[2Jb\x7f\n", 20), "a?[2Jb??");
  EXPECT_EQ(Tame("x\xC2\x9Bm", 20), "x?m");          // a control of eight bits, in UTF-8
  EXPECT_EQ(Tame("t\xC3\xB6rus", 3), "t\xC3\xB6r");  // cut between characters
  EXPECT_EQ(Tame("a\u202Eb\u2066c\u200Fd\u2028e", 20), "a?b?c?d?e") << "order of writing";
  EXPECT_EQ(Tame("a\xFF\xC3(", 20),
            "a?"
            "?(")
      << "no UTF-8";
}

TEST(TopTable, LabelsCommandNoTerminal) {
  TopTable table(TopOrder::kState);
  table.Update({Mesh("aaaaaaaaaa", "evil\u202E\033[2J", MeshState::kRunning, 10, 5)}, 0);
  for (const int width : {0, 200}) {
    const std::string line = table.Lines(width, 0).back();
    EXPECT_NE(line.find("evil??[2J"), std::string::npos) << line;
  }
}

TEST(ShortTime, IsShort) {
  EXPECT_EQ(ShortTime(0), "-");
  EXPECT_EQ(ShortTime(4.24), "4.2s");
  EXPECT_EQ(ShortTime(59.97), "1m00s");
  EXPECT_EQ(ShortTime(192), "3m12s");
  EXPECT_EQ(ShortTime(3 * 3600 + 7 * 60), "3h07m");
  EXPECT_EQ(ShortTime(-1), "-");
}

}  // namespace
}  // namespace stellate::cli
