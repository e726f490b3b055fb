#include "server/history/mesh_history.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <new>
#include <random>
#include <set>
#include <string>
#include <string_view>

#include "core/base/arenas.h"

namespace {
std::atomic<std::uint64_t> allocated{0};  // on the heap, in this process
}  // namespace

void* operator new(std::size_t size) {
  void* const block = std::malloc(size);
  if (block == nullptr) throw std::bad_alloc();
  allocated += malloc_usable_size(block);
  return block;
}
void operator delete(void* block) noexcept {
  allocated -= malloc_usable_size(block);
  std::free(block);
}
void operator delete(void* block, std::size_t) noexcept { operator delete(block); }

namespace stellate::server {
namespace {

using Triangle = std::vector<std::uint32_t>;
using State = std::multiset<Triangle>;

constexpr int kDimension = 2, kAmbient = 3;

core::MeshDelta Delta(std::uint64_t revision, std::uint64_t first, int vertices,
                      const std::vector<Triangle>& added, const std::vector<Triangle>& removed) {
  core::MeshDelta delta;
  delta.revision = revision;
  delta.first_vertex = first;
  delta.points.resize(kAmbient, vertices);
  for (int j = 0; j < vertices; ++j)
    delta.points.col(j).setConstant(static_cast<double>(first) + j);
  for (const auto& t : added) delta.added.insert(delta.added.end(), t.begin(), t.end());
  for (const auto& t : removed) delta.removed.insert(delta.removed.end(), t.begin(), t.end());
  return delta;
}

// A client: what it holds after reading parts in order.
struct Client {
  std::uint64_t revision = 0;
  std::vector<double> points;
  State state;

  void Apply(const DeltaPart& part) {
    std::set<Triangle> gone;
    for (std::size_t i = 0; i < part.removed.size(); i += 3) {
      gone.emplace(part.removed.begin() + i, part.removed.begin() + i + 3);
    }
    for (std::size_t i = 0; i < part.added.size(); i += 3) {
      EXPECT_FALSE(gone.contains({part.added.begin() + i, part.added.begin() + i + 3}));
    }
    if (!part.points.empty()) {
      EXPECT_EQ(part.first_vertex * kAmbient, points.size());
    }
    points.insert(points.end(), part.points.begin(), part.points.end());
    for (std::size_t i = 0; i < part.removed.size(); i += 3) {
      const auto it = state.find(Triangle(part.removed.begin() + i, part.removed.begin() + i + 3));
      ASSERT_NE(it, state.end()) << "removed but not there";
      state.erase(it);
    }
    for (std::size_t i = 0; i < part.added.size(); i += 3) {
      state.insert(Triangle(part.added.begin() + i, part.added.begin() + i + 3));
    }
    if (part.complete) revision = part.revision;
  }

  void CatchUp(const MeshHistory& history, std::size_t max_bytes) {
    MeshHistory::Cursor cursor = history.Begin(revision);
    for (DeltaPart part;;) {
      part = history.Next(&cursor, max_bytes);
      Apply(part);
      if (part.complete) return;
    }
  }
};

// Random growth; states[r] is the mesh at revision r.
struct History {
  MeshHistory mesh{kDimension, kAmbient};
  std::vector<State> states{State{}};
  std::vector<std::size_t> vertices{0};

  void Grow(int revisions, std::mt19937* random) {
    for (int i = 0; i < revisions; ++i) {
      const auto revision = states.size();
      const auto first = static_cast<std::uint32_t>(vertices.back());
      State state = states.back();
      std::vector<Triangle> removed, added;
      for (auto it = state.begin(); it != state.end();) {
        if ((*random)() % 3 == 0) {
          removed.push_back(*it);
          it = state.erase(it);
        } else {
          ++it;
        }
      }
      for (int t = 0; t < 6; ++t) {
        // Few vertices, so that the same triangle goes and comes again.
        const std::uint32_t limit = std::min(first + 3, 6u);
        Triangle triangle{static_cast<std::uint32_t>((*random)() % (limit - 2)), limit - 2,
                          limit - 1};
        if (state.contains(triangle)) continue;
        state.insert(triangle);
        added.push_back(triangle);
      }
      ASSERT_TRUE(mesh.Append(Delta(revision, first, 3, added, removed)).ok());
      states.push_back(state);
      vertices.push_back(first + 3);
    }
  }
};

class MeshHistoryTest : public ::testing::TestWithParam<std::size_t> {};

// Whatever was read before and however small the parts, the state arrived at is the same.
TEST_P(MeshHistoryTest, AnyRevisionLeadsToAnyLaterOne) {
  std::mt19937 random(7);
  History history;
  std::vector<Client> clients(1);
  for (int step = 0; step < 12; ++step) {
    history.Grow(1 + step % 3, &random);
    clients.push_back(clients[random() % clients.size()]);
    clients.back().CatchUp(history.mesh, GetParam());
  }
  for (Client client : clients) {
    ASSERT_EQ(client.state, history.states[client.revision]);
    client.CatchUp(history.mesh, GetParam());
    EXPECT_EQ(client.revision, history.states.size() - 1);
    EXPECT_EQ(client.state, history.states.back());
    ASSERT_EQ(client.points.size(), history.vertices.back() * kAmbient);
    for (std::size_t i = 0; i < client.points.size(); ++i) {
      EXPECT_EQ(client.points[i], static_cast<double>(i / kAmbient));
    }
  }
}
INSTANTIATE_TEST_SUITE_P(PartSizes, MeshHistoryTest, ::testing::Values(24, 60, 1 << 20));

// Of arrangements: each simplex comes with its label, in any part, and from a record.
TEST(MeshHistory, LabelsComeWithTheirSimplices) {
  MeshHistory mesh(kDimension, kAmbient);
  core::MeshDelta first = Delta(1, 0, 4, {{0, 1, 2}, {1, 2, 3}}, {});
  first.labels = {5, 6};
  core::MeshDelta second = Delta(2, 4, 1, {{0, 1, 4}, {0, 2, 4}}, {{0, 1, 2}});
  second.labels = {7, 8};
  ASSERT_TRUE(mesh.Append(first).ok());
  ASSERT_TRUE(mesh.Append(second).ok());
  std::string bytes;
  ASSERT_TRUE(mesh.Write([&](const void* data, std::size_t size) {
    bytes.append(static_cast<const char*>(data), size);
    return true;
  }));
  std::size_t at = 0;
  const auto copy = MeshHistory::Read(kDimension, kAmbient, [&](void* data, std::size_t size) {
    if (bytes.size() - at < size) return false;
    std::copy_n(bytes.data() + at, size, static_cast<char*>(data));
    at += size;
    return true;
  });
  ASSERT_TRUE(copy) << copy.error().message;
  for (const MeshHistory* history : {&mesh, copy->get()})
    for (const std::size_t max_bytes : {12, 1 << 20}) {
      std::map<Triangle, int> labels;
      MeshHistory::Cursor cursor = history->BeginAt(2, 0);
      for (DeltaPart part; !part.complete;) {
        part = history->Next(&cursor, max_bytes);
        ASSERT_EQ(part.labels.size() * 3, part.added.size());
        for (std::size_t i = 0; i < part.labels.size(); ++i)
          labels[{part.added.begin() + 3 * i, part.added.begin() + 3 * i + 3}] = part.labels[i];
      }
      EXPECT_EQ(labels, (std::map<Triangle, int>{{{1, 2, 3}, 6}, {{0, 1, 4}, 7}, {{0, 2, 4}, 8}}));
    }
}

// The boundary alone has two labels for each simplex, which say where outside is.
TEST(MeshHistory, TurnsABoundaryByItsLabels) {
  MeshHistory mesh(2, 3, 2);
  core::MeshDelta delta = Delta(1, 0, 4, {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}}, {});
  delta.labels = {0, 1, 1, 0, 0, 2, 2, 1};
  ASSERT_TRUE(mesh.Append(delta).ok());
  mesh.Orient();
  ASSERT_TRUE(mesh.orientation());
  EXPECT_TRUE(mesh.orientation()->orientable);
  EXPECT_EQ(mesh.orientation()->turned, std::vector<std::uint8_t>{0b0101});
  MeshHistory::Cursor cursor = mesh.Begin(0);
  EXPECT_EQ(mesh.Next(&cursor, 1 << 20).labels, delta.labels);
}

TEST(MeshHistory, APartBegunBeforeMoreCameLeadsWhereItSaid) {
  std::mt19937 random(11);
  History history;
  history.Grow(5, &random);
  Client client;
  MeshHistory::Cursor cursor = history.mesh.Begin(0);
  client.Apply(history.mesh.Next(&cursor, 24));
  history.Grow(5, &random);  // between two parts
  while (client.revision == 0) client.Apply(history.mesh.Next(&cursor, 24));
  EXPECT_EQ(client.revision, 5u);
  EXPECT_EQ(client.state, history.states[5]);
}

TEST(MeshHistory, PartsKeepToTheirSize) {
  std::mt19937 random(3);
  History history;
  history.Grow(30, &random);
  MeshHistory::Cursor cursor = history.mesh.Begin(0);
  for (bool complete = false; !complete;) {
    const DeltaPart part = history.mesh.Next(&cursor, 100);
    EXPECT_LE(8 * part.points.size() + 4 * (part.added.size() + part.removed.size()), 100u);
    complete = part.complete;
  }
}

TEST(MeshHistory, RefusesWhatDoesNotFollow) {
  MeshHistory history(kDimension, kAmbient);
  ASSERT_TRUE(history.Append(Delta(1, 0, 4, {{0, 1, 2}, {1, 2, 3}}, {})).ok());
  EXPECT_FALSE(history.Append(Delta(3, 4, 1, {}, {})).ok()) << "a revision left out";
  EXPECT_FALSE(history.Append(Delta(2, 9, 1, {}, {})).ok()) << "vertices left out";
  EXPECT_FALSE(history.Append(Delta(2, 4, 0, {}, {{1, 2, 3}, {0, 1, 3}})).ok()) << "not there";
  EXPECT_FALSE(history.Append(Delta(2, 4, 0, {}, {{9, 10, 11}})).ok()) << "not even its vertices";
  EXPECT_FALSE(history.Append(Delta(2, 4, 1, {{5, 6, 7}}, {})).ok()) << "a vertex left out";
  EXPECT_EQ(history.revision(), 1u);
  EXPECT_TRUE(history.Append(Delta(2, 4, 0, {}, {{1, 2, 3}})).ok()) << "a refusal changes nothing";
}

TEST(MeshHistory, ARevisionIsOnePartWhereItFits) {
  MeshHistory history(kDimension, kAmbient);
  ASSERT_TRUE(history.Append(Delta(1, 0, 4, {{0, 1, 2}, {1, 2, 3}}, {})).ok());
  ASSERT_TRUE(history.Append(Delta(2, 4, 1, {{0, 1, 4}, {0, 2, 4}}, {{0, 1, 2}})).ok());
  MeshHistory::Cursor cursor = history.Begin(1);
  const DeltaPart part = history.Next(&cursor, 1000);
  EXPECT_TRUE(part.complete);
  EXPECT_EQ(part.removed, (Triangle{0, 1, 2}));
  EXPECT_EQ(part.points.size(), 3u);
  EXPECT_EQ(part.added, (Triangle{0, 1, 4, 0, 2, 4}));
}

// Any revision, read in parts, each by a reader that knows but the position.
TEST(MeshHistory, EveryRevisionIsReadFromAnyPosition) {
  std::mt19937 random(5);
  History history;
  history.Grow(12, &random);
  for (std::uint64_t revision = 0; revision < history.states.size(); ++revision) {
    const MeshHistory::Snapshot snapshot = history.mesh.At(revision);
    EXPECT_EQ(snapshot.vertices, history.vertices[revision]);
    EXPECT_EQ(snapshot.simplices, history.states[revision].size());
    for (const std::size_t bytes : {std::size_t{1}, std::size_t{200}, std::size_t{1} << 20}) {
      Client client;
      std::uint64_t position = 0;
      for (bool complete = false; !complete;) {
        MeshHistory::Cursor cursor = history.mesh.BeginAt(revision, position);
        const DeltaPart part = history.mesh.Next(&cursor, bytes);
        EXPECT_TRUE(part.removed.empty());
        EXPECT_TRUE(part.complete || cursor.Position() > position) << "it gets on";
        client.Apply(part);
        position = cursor.Position();
        complete = part.complete;
      }
      EXPECT_EQ(position, snapshot.positions);
      EXPECT_EQ(client.points.size(), kAmbient * snapshot.vertices);
      EXPECT_EQ(client.state, history.states[revision]);
    }
  }
}

// Reads on from a position with `bytes` at a time, a cursor for each part.
std::vector<Triangle> ReadOn(const MeshHistory& mesh, std::uint64_t position, std::size_t bytes,
                             bool* is_oriented) {
  std::vector<Triangle> rows;
  for (bool complete = false; !complete;) {
    MeshHistory::Cursor cursor = mesh.BeginAt(mesh.revision(), position);
    const DeltaPart part = mesh.Next(&cursor, bytes);
    *is_oriented = part.orientation.has_value();
    for (std::size_t i = 0; i < part.added.size(); i += 3)
      rows.emplace_back(part.added.begin() + i, part.added.begin() + i + 3);
    position = cursor.Position();
    complete = part.complete;
  }
  return rows;
}

TEST(MeshHistory, TheLastRevisionIsInOrderOnceItIsOriented) {
  std::mt19937 random(7);
  History history;
  history.Grow(12, &random);
  MeshHistory& mesh = history.mesh;
  const std::uint64_t last = mesh.revision();
  MeshHistory::Cursor early = mesh.BeginAt(last, mesh.At(last).vertices);
  mesh.Next(&early, 40);
  const std::uint64_t begun = early.Position();
  ASSERT_GT(begun, mesh.At(last).vertices);
  bool is_oriented = false;
  const std::vector<Triangle> unsorted = ReadOn(mesh, begun, 100, &is_oriented);
  EXPECT_FALSE(is_oriented);
  EXPECT_EQ(mesh.At(last).most_positions - mesh.At(last).positions, mesh.At(last).simplices);

  mesh.Orient();
  const std::vector<Triangle> sorted(history.states[last].begin(), history.states[last].end());
  for (const std::size_t bytes : {1, 100, 100'000}) {
    EXPECT_EQ(ReadOn(mesh, 0, bytes, &is_oriented), sorted);
    EXPECT_TRUE(is_oriented);
    // What was begun before goes on as it was, also with a cursor of its own.
    EXPECT_EQ(ReadOn(mesh, begun, bytes, &is_oriented), unsorted);
    EXPECT_FALSE(is_oriented);
  }
  EXPECT_EQ(mesh.At(last).most_positions, mesh.At(last).positions);
  EXPECT_TRUE(ReadOn(mesh, mesh.At(last).positions, 1, &is_oriented).empty()) << "the end";
}

// A strip of triangles, all in one round.
core::MeshDelta Strip(std::uint32_t vertices) {
  core::MeshDelta delta;
  delta.revision = 1;
  delta.points = Eigen::MatrixXd::Zero(kAmbient, vertices);
  for (std::uint32_t v = 0; v + 2 < vertices; ++v) {
    delta.added.insert(delta.added.end(), {v, v + 1, v + 2});
  }
  return delta;
}

TEST(MeshHistory, MemoryIsThatOfTheHeap) {
  for (const std::uint32_t vertices : {3u, 1000u, 100'000u}) {
    const core::MeshDelta delta = Strip(vertices);
    const std::uint64_t before = allocated;
    const auto history = std::make_unique<MeshHistory>(2, kAmbient);
    ASSERT_TRUE(history->Append(delta).ok());
    const auto held = static_cast<double>(allocated - before);
    const auto counted = static_cast<double>(history->MemoryBytes());
    EXPECT_GE(counted, 0.9 * held) << vertices;
    EXPECT_LE(counted, 1.1 * held) << vertices;
  }
}

// The boundary of a tetrahedron, after a detour, so that rows do not come in lexicographic order.
std::unique_ptr<MeshHistory> Tetrahedron() {
  auto history = std::make_unique<MeshHistory>(kDimension, kAmbient);
  core::MeshDelta corners = Delta(1, 0, 4, {{1, 2, 3}, {0, 1, 2}, {0, 2, 3}}, {});
  corners.points << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  EXPECT_TRUE(history->Append(corners).ok());
  EXPECT_TRUE(history->Append(Delta(2, 4, 0, {{0, 1, 3}, {0, 1, 2}}, {{0, 1, 2}})).ok());
  return history;
}

// With normals outwards, by hand: 0 is the origin.
const State kOutwards{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

bool IsTurned(const core::Orientation& orientation, std::size_t i) {
  return (orientation.turned[i / 8] >> (i % 8) & 1) != 0;
}

// What a download of the newest revision says, in parts.
State Oriented(const MeshHistory& history, std::size_t max_bytes) {
  State state;
  MeshHistory::Cursor cursor = history.BeginAt(history.revision(), 0);
  for (DeltaPart part; !part.complete;) {
    part = history.Next(&cursor, max_bytes);
    for (std::size_t i = 0; 3 * i < part.added.size(); ++i) {
      Triangle row(part.added.begin() + 3 * i, part.added.begin() + 3 * i + 3);
      if (IsTurned(*part.orientation, i)) std::swap(row[1], row[2]);
      state.insert(row);
    }
  }
  return state;
}

TEST(MeshHistory, TellsTheOrientationOfTheLastRevisionAlone) {
  const auto history = Tetrahedron();
  EXPECT_FALSE(history->orientation());
  MeshHistory::Cursor early = history->BeginAt(2, 0);
  history->Orient();
  ASSERT_TRUE(history->orientation());
  const std::vector<Triangle> sorted{{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
  State state;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    Triangle row = sorted[i];
    if (IsTurned(*history->orientation(), i)) std::swap(row[1], row[2]);
    state.insert(row);
  }
  EXPECT_EQ(state, kOutwards);
  for (const std::size_t bytes : {1, 60, 1000}) EXPECT_EQ(Oriented(*history, bytes), kOutwards);
  EXPECT_FALSE(history->Next(&early, 1000).orientation) << "one answer through a download";
  MeshHistory::Cursor first = history->BeginAt(1, 0), change = history->Begin(0);
  EXPECT_FALSE(history->Next(&first, 1000).orientation);
  EXPECT_FALSE(history->Next(&change, 1000).orientation);
  EXPECT_FALSE(history->Append(Delta(3, 4, 0, {}, {{0, 1, 2}})).ok()) << "it was the last";
}

TEST(MeshHistory, AnInterruptedOrientationIsNone) {
  const auto history = Tetrahedron();
  core::Interruption interruption;
  interruption.Raise();
  EXPECT_FALSE(core::WithThreads(1, interruption, [&] { history->Orient(); }));
  EXPECT_FALSE(history->orientation());
}

// What was written, and what is read back from it.
struct Written {
  std::string bytes;
  explicit Written(const MeshHistory& history) {
    history.Write([this](const void* data, std::size_t size) {
      bytes.append(static_cast<const char*>(data), size);
      return true;
    });
  }
  core::Expected<std::unique_ptr<MeshHistory>> Read() const {
    return MeshHistory::Read(
        kDimension, kAmbient,
        [left = std::string_view(bytes)](void* data, std::size_t size) mutable {
          if (left.size() < size) return false;
          std::memcpy(data, left.data(), size);
          left.remove_prefix(size);
          return true;
        });
  }
};

TEST(MeshHistory, IsReadBackWithItsOrientation) {
  const auto history = Tetrahedron();
  auto read = Written(*history).Read();
  ASSERT_TRUE(read);
  EXPECT_FALSE((*read)->orientation());
  history->Orient();
  Written written(*history);
  read = written.Read();
  ASSERT_TRUE(read);
  EXPECT_EQ((*read)->orientation(), history->orientation());
  EXPECT_EQ(Oriented(**read, 30), kOutwards);
  written.bytes.pop_back();
  EXPECT_FALSE(written.Read()) << "a byte is missing";

  MeshHistory fan(kDimension, kAmbient);
  ASSERT_TRUE(fan.Append(Delta(1, 0, 5, {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}}, {})).ok());
  fan.Orient();
  read = Written(fan).Read();
  ASSERT_TRUE(read && (*read)->orientation());
  EXPECT_FALSE((*read)->orientation()->orientable);
}

TEST(Places, ComeWithThePointsOfTheLastRevision) {
  MeshHistory mesh(kDimension, kAmbient);
  const PointPlaces places{{0, 1, 2, 10}, Eigen::MatrixXd::Random(kAmbient, 4)};
  ASSERT_TRUE(mesh.Append(Delta(1, 0, 4, {}, {})).ok());
  EXPECT_FALSE(mesh.Append(Delta(2, 4, 0, {{0, 1, 2}}, {}), {{0, 1}, {}}).ok()) << "two of four";
  ASSERT_TRUE(mesh.Append(Delta(2, 4, 0, {{0, 1, 2}}, {}), places).ok());
  const auto read = Written(mesh).Read();
  ASSERT_TRUE(read);
  for (const MeshHistory* const history :
       std::initializer_list<const MeshHistory*>{&mesh, read->get()}) {
    std::vector<std::uint8_t> codes;
    std::vector<double> smoothed;
    MeshHistory::Cursor cursor = history->BeginAt(2, 0);
    DeltaPart part;
    do {
      part = history->Next(&cursor, 100);  // two points at a time
      EXPECT_LE(part.places.size(), 2u);
      codes.insert(codes.end(), part.places.begin(), part.places.end());
      smoothed.insert(smoothed.end(), part.smoothed.begin(), part.smoothed.end());
    } while (!part.complete);
    EXPECT_EQ(codes, places.codes);
    EXPECT_EQ(Eigen::Map<Eigen::MatrixXd>(smoothed.data(), kAmbient, 4), places.smoothed);
    cursor = history->BeginAt(1, 0);
    EXPECT_TRUE(history->Next(&cursor, 1000).places.empty()) << "it was not known then";
  }
}

}  // namespace
}  // namespace stellate::server
