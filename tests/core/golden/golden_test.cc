// Runs are compared with their records, a file each in this directory: a change of behaviour is a
// diff of these, which somebody has to read and to explain. A file begins with a paragraph in
// words, written by hand; `core_golden_test --rewrite` keeps it and records anew what follows.

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/core/golden/golden_cases.h"
#include "tests/core/support/thread_peers.h"

namespace stellate::core {
namespace {

using testing::Answerer;
using testing::AnswererFor;
using testing::GoldenCase;

bool rewrite = false;

// FNV-1a over the bytes of what is added.
class Digest {
 public:
  Digest& Add(const void* bytes, std::size_t size) {
    const auto* at = static_cast<const unsigned char*>(bytes);
    for (std::size_t i = 0; i < size; ++i) hash_ = (hash_ ^ at[i]) * 0x100000001b3ull;
    return *this;
  }
  template <typename T>
  Digest& Add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    return Add(&value, sizeof(value));
  }
  template <typename T>
  Digest& Add(const std::vector<T>& values) {
    return Add(values.size()).Add(values.data(), values.size() * sizeof(T));
  }
  template <int R, int C>
  Digest& Add(const Eigen::Matrix<double, R, C>& m) {
    return Add(m.rows()).Add(m.cols()).Add(m.data(),
                                           static_cast<std::size_t>(m.size()) * sizeof(double));
  }
  std::string Hex() const {
    char text[20];
    std::snprintf(text, sizeof(text), "%016" PRIx64, hash_);
    return text;
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ull;
};

Digest DigestOf(const QueryBatch& batch) {
  Digest digest;
  for (const QueryBlock& block : batch.blocks)
    digest.Add(block.kind)
        .Add(block.points)
        .Add(block.bases)
        .Add(block.radii)
        .Add(block.want.tangents)
        .Add(block.want.sizes);
  return digest;
}

Digest DigestOf(const Progress& p) {
  return Digest()
      .Add(p.phase)
      .Add(p.round)
      .Add(p.queries)
      .Add(p.vertices)
      .Add(p.simplices)
      .Add(p.unbounded_stars)
      .Add(p.bad_size)
      .Add(p.bad_radius_edge)
      .Add(p.bad_sliver)
      .Add(p.bad_inconsistent)
      .Add(p.fraction);
}

std::string Number(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  return text;
}

// "name number" of each that is not 0.
std::string Named(const std::vector<std::pair<const char*, std::uint64_t>>& numbers) {
  std::string text;
  for (const auto& [name, number] : numbers)
    if (number > 0) text += (text.empty() ? "" : ", ") + (name + (' ' + std::to_string(number)));
  return text;
}

std::string Broken(const Progress& p) {
  const std::string broken = Named({{"front", p.unbounded_stars},
                                    {"R1", p.bad_size},
                                    {"R2", p.bad_radius_edge},
                                    {"R3", p.bad_sliver},
                                    {"R4", p.bad_inconsistent}});
  return broken.empty() ? "" : "; broken " + broken;
}

// Beyond those that `before` counts.
std::string Inserted(const Counts& now, const Counts& before = {}) {
  const std::string inserted =
      Named({{"R1", now.inserted_size - before.inserted_size},
             {"R2", now.inserted_radius_edge - before.inserted_radius_edge},
             {"R3", now.inserted_sliver - before.inserted_sliver},
             {"R4", now.inserted_inconsistent - before.inserted_inconsistent}});
  return inserted.empty() ? "" : "; inserted " + inserted;
}

void WriteFirst(const Eigen::MatrixXd& points, std::ostream& out) {
  static const Eigen::IOFormat in_clear(4, Eigen::DontAlignCols, ", ", " ", "(", ")");
  if (points.cols() == 0) return;
  out << "  "
      << points.leftCols(std::min<Eigen::Index>(3, points.cols())).transpose().format(in_clear)
      << '\n';
}

constexpr const char* kLegend =
    R"(round: queries; vertices and simplices after it; stars on the front and stars that break R1 .. R4;
  points inserted by R1 .. R4
  the first three new points
  digests of queries, new points, their tangents, delta, progress
)";
constexpr const char* kLegendOfWalls =
    R"(  number of walls: new vertices on so many; digests of the faces asked for, of those vertices' walls
  and of all labels
)";

void WriteEnd(const Report& report, std::ostream& out) {
  const Counts& n = report.counts;
  const Certificate& c = report.certificate;
  out << "ended " << TerminationName(report.termination) << ' '
      << StatusCodeName(report.failure.code) << ' ' << CertificateLevelName(c.level) << '\n';
  if (!report.failure.message.empty()) out << "failure: " << report.failure.message << '\n';
  out << "counts: " << n.vertices << " vertices, " << n.simplices << " simplices, " << n.rounds
      << " rounds, " << n.queries << " queries, " << n.tangent_queries << " for tangents, "
      << n.duplicates << " duplicates" << Inserted(n) << '\n'
      << "mesh: components " << c.components << ", Euler characteristic " << c.euler_characteristic
      << ", inconsistent simplices " << c.inconsistent_simplices << ", circumradius "
      << Number(c.max_circumradius) << ", reach " << Number(c.estimated_reach)
      << ", epsilon / reach " << Number(c.epsilon_over_reach) << '\n'
      << "verdict: " << c.verdict << '\n';
  for (const std::string& warning : c.warnings) out << "warning: " << warning << '\n';
}

// How many of the new vertices are on each number of walls, and digests of which faces were asked
// for, of the new vertices' walls and of all labels.
void WriteWalls(const Mesher& mesher, const QueryBatch& batch, const MeshDelta& delta,
                std::ostream& out) {
  Digest faces;
  for (const QueryBlock& block : batch.blocks) faces.Add(block.face).Add(block.want.clearances);
  std::map<int, std::size_t> on_walls;
  for (const WallSet walls : delta.walls) ++on_walls[std::popcount(walls)];
  out << "  on walls";
  for (const auto& [count, vertices] : on_walls) out << ' ' << count << ": " << vertices << ';';
  out << ' ' << faces.Hex() << ' ' << Digest().Add(delta.walls).Hex() << ' '
      << Digest().Add(mesher.Labels()).Hex() << '\n';
}

// What is meshed, and who answers.
struct Subject {
  Specification spec;
  Answerer answer;
};

Subject SubjectOf(const GoldenCase& c) {
  if (c.walled) {
    const auto& walled = *c.walled;
    const auto domain = std::make_shared<stellate::testing::Domain>(walled.domain);
    return {walled.label ? walled.SpecificationFor(c.epsilon)
                         : walled.domain.SpecificationFor(c.epsilon),
            [domain](const QueryBatch& batch) { return domain->AnswersOf(batch); }};
  }
  const std::shared_ptr<Oracle> manifold = testing::Make(c.manifold);
  return {testing::SpecificationFor(*manifold, c.epsilon),
          [manifold](const QueryBatch& batch) { return testing::AnswersOf(*manifold, batch); }};
}

// What a run does, round by round, and how it ends.
std::string Record(const GoldenCase& c, int threads, const Peers& peers = NoPeers()) {
  auto [spec, answer] = SubjectOf(c);
  c.change(spec);
  const auto mesher = std::move(*Mesher::CreatePart(spec, peers, {.threads = threads}));
  std::ostringstream out;
  out << kLegend << (spec.walls > 0 ? kLegendOfWalls : "");
  std::string phase;
  while (const auto batch = mesher->NextBatch()) {
    if (std::exchange(phase, PhaseName(mesher->progress().phase)) != phase)
      out << "phase " << phase << '\n';
    const std::uint64_t round = batch->round;
    if (round == c.cancel_before) {
      mesher->Cancel();
      continue;
    }
    if (round == c.fail_before) {
      mesher->Fail({StatusCode::kOracleFailed, "the oracle has gone"});
      continue;
    }
    if (round == c.interrupt_before) mesher->Interrupt();
    const Eigen::Index queries = batch->size();
    const Digest asked = DigestOf(*batch);
    const Answers good = answer(*batch);
    Answers given = good;
    if (c.spoil) c.spoil(spec, *batch, given);
    const Counts before = mesher->report().counts;
    auto delta = mesher->Absorb(given);
    if (!delta) {
      out << "refused: " << StatusCodeName(delta.error().code) << ' ' << delta.error().message
          << '\n';
      if (delta.error().code == StatusCode::kCancelled) {
        mesher->Cancel();
        continue;
      }
      EXPECT_EQ(DigestOf(*mesher->NextBatch()).Hex(), asked.Hex());
      delta = mesher->Absorb(good);
      if (!delta) return out.str() + "refused again: " + delta.error().message + '\n';
    }
    const Eigen::MatrixXd tangents = mesher->Tangents().rightCols(delta->points.cols());
    const Progress& progress = mesher->progress();
    out << "round " << round << ": " << queries << " queries; " << progress.vertices
        << " vertices, " << progress.simplices << " simplices" << Broken(progress)
        << Inserted(mesher->report().counts, before) << '\n';
    WriteFirst(delta->points, out);
    out << "  " << asked.Hex() << ' ' << Digest().Add(delta->points).Hex() << ' '
        << Digest().Add(tangents).Hex() << ' '
        << Digest()
               .Add(delta->revision)
               .Add(delta->first_vertex)
               .Add(delta->added)
               .Add(delta->removed)
               .Hex()
        << ' ' << DigestOf(progress).Hex() << '\n';
    if (spec.walls > 0) WriteWalls(*mesher, *batch, *delta, out);
  }
  out << "whole mesh, digests of points, tangents, simplices, progress\n  "
      << Digest().Add(Eigen::MatrixXd(mesher->Points())).Hex() << ' '
      << Digest().Add(mesher->Tangents()).Hex() << ' ' << Digest().Add(mesher->Simplices()).Hex()
      << ' ' << DigestOf(mesher->progress()).Hex() << '\n';
  WriteEnd(mesher->report(), out);
  return out.str();
}

// What this machine computes where IEEE 754 leaves it a choice: whether products and sums are
// fused, where the manifolds' closest points are compiled, and the C library's functions, which
// differ from processor to processor.
std::string FusedSums() {
  Digest digest;
  volatile double x = 0.1;
  for (int i = 0; i < 2000; ++i) digest.Add(x * i * x + x);
  return digest.Hex();
}
std::string LibraryFunctions() {
  Digest digest;
  volatile double x = 0.1;
  for (int i = 0; i < 2000; ++i) {
    digest.Add(std::pow(x * i, 1.5)).Add(std::sin(x * i)).Add(std::cos(x * i));
    digest.Add(std::exp(-x * i)).Add(std::log(1 + x * i));
  }
  return digest.Hex();
}
std::string Arithmetic() { return FusedSums() + '\n' + LibraryFunctions() + '\n'; }

std::string Path(std::string_view name) {
  return std::string(STELLATE_GOLDEN_DIR) + '/' + std::string(name) + ".txt";
}

std::string ReadFile(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

void WriteFile(const std::string& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  ASSERT_TRUE(out.flush()) << "cannot write " << path;
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Whether a record can be held to the last bit: the core rounds alike everywhere, answers may not.
bool AnswersAsRecorded(const GoldenCase& c) {
  const std::vector<std::string> then = Lines(ReadFile(Path("arithmetic")));
  return then.size() == 2 && then[0] == FusedSums() &&
         (!c.answered_by_library || then[1] == LibraryFunctions());
}

// Where answers are rounded otherwise no more than how the run ended is compared.
std::vector<std::string> HowItEnded(const std::string& record) {
  std::vector<std::string> ending;
  for (const std::string& line : Lines(record))
    if (line.starts_with("ended ")) ending.push_back(line);
  return ending;
}

// The paragraph that somebody wrote, with the empty line after it. A record itself has no such
// line.
std::string Opening(const std::string& file) {
  const auto end = file.find("\n\n");
  return end == std::string::npos ? "" : file.substr(0, end + 2);
}

void ExpectRecorded(const GoldenCase& c, const std::string& record) {
  const std::string path = Path(c.name);
  const std::string opening = Opening(ReadFile(path));
  ASSERT_FALSE(opening.empty())
      << path << " has to begin with a paragraph and an empty line: what M is, what the run shows, "
      << "what to look at. Write them; core_golden_test --rewrite appends the record.";
  const std::string now = opening + record;
  if (rewrite) WriteFile(path, now);
  const std::string then = ReadFile(path);
  const bool exact = AnswersAsRecorded(c);
  const auto was = exact ? Lines(then) : HowItEnded(then);
  const auto is = exact ? Lines(now) : HowItEnded(now);
  for (std::size_t i = 0; i < std::max(was.size(), is.size()); ++i) {
    const std::string a = i < was.size() ? was[i] : "(no such line)";
    const std::string b = i < is.size() ? is[i] : "(no such line)";
    ASSERT_EQ(a, b) << "line " << i + 1 << " of " << path
                    << " is the first that differs. If that is meant, record anew with "
                       "core_golden_test --rewrite and say why in the commit.";
  }
}

class GoldenFiles : public ::testing::TestWithParam<GoldenCase> {};

TEST_P(GoldenFiles, TellWhatTheMesherDoes) {
  const GoldenCase& c = GetParam();
  const std::string one = Record(c, 1);
  ExpectRecorded(c, one);
  EXPECT_EQ(Record(c, 4), one) << "4 threads";
}

// Parts that share the work tell all of it, each. No part is interrupted.
TEST_P(GoldenFiles, TellWhatEachPartOfItDoes) {
  const GoldenCase& c = GetParam();
  if (c.interrupt_before > 0) return;
  const std::string whole = Record(c, 1);
  constexpr std::size_t kMostLines = 300;  // of records that are made once more, by five
  for (const int parts : {2, 5}) {
    if (parts > 2 && Lines(whole).size() > kMostLines) continue;
    testing::ThreadPeers all(parts);
    std::vector<std::string> records(static_cast<std::size_t>(parts));
    all.Run([&](const Peers& peers) {
      records[static_cast<std::size_t>(peers.part())] = Record(c, 1, peers);
    });
    for (const std::string& record : records) EXPECT_EQ(record, whole) << parts << " parts";
    const bool has_stars = whole.find("ended CONVERGED") != std::string::npos;
    EXPECT_TRUE(!has_stars || all.exchanges() > 0) << "they share nothing";
  }
}

std::string NameOf(const ::testing::TestParamInfo<GoldenCase>& tested) { return tested.param.name; }

INSTANTIATE_TEST_SUITE_P(Recorded, GoldenFiles, ::testing::ValuesIn(testing::golden::Cases()),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(RecordedWalls, GoldenFiles,
                         ::testing::ValuesIn(testing::golden::WalledCases()), NameOf);

}  // namespace
}  // namespace stellate::core

int main(int argc, char** argv) {
  using namespace stellate::core;
  ::testing::InitGoogleTest(&argc, argv);
  for (int i = 1; i < argc; ++i) rewrite = rewrite || std::string_view(argv[i]) == "--rewrite";
  if (rewrite)
    WriteFile(Path("arithmetic"), Arithmetic());
  else if (ReadFile(Path("arithmetic")) != Arithmetic())
    std::puts("This machine rounds otherwise than the recording one.");
  return RUN_ALL_TESTS();
}
