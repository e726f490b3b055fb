// The C++ client and the files of this folder; README.md says what they are.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <ostream>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "exit_status.h"
#include "files.h"
#include "net/embedded_server.h"
#include "replay.h"
#include "silent_oracle.h"
#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "stellate/doctor.h"
#include "support/spoiled_oracle.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::testing {
namespace {

// An entry that a failing test is named by.
struct Case {
  Entry entry;
};
void PrintTo(const Case& c, std::ostream* out) { *out << TextAt(c.entry, "name"); }

std::vector<Case> Cases(const std::string& file) {
  std::vector<Case> cases;
  for (Entry& entry : ListOf(file)) cases.push_back({std::move(entry)});
  return cases;
}

std::string NameOf(const ::testing::TestParamInfo<Case>& info) {
  std::string name = TextAt(info.param.entry, "name");
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

std::string Scratch(const std::string& name, const std::string& ending) {
  std::string path = ::testing::TempDir();
  path.append(name).append(1, '.').append(ending);
  return path;
}

class Stream : public ::testing::TestWithParam<Case> {};

TEST_P(Stream, MakesThisMesh) {
  const Entry& entry = GetParam().entry;
  Replay replay(entry);
  Silent oracle(static_cast<int>(NumberAt(entry, "dimension")),
                static_cast<int>(NumberAt(entry, "ambient_dimension")));
  MeshOptions options;
  options.epsilon = 1;
  options.connection.server = replay.address();
  const Expected<Mesh> mesh = MeshManifold(oracle, options);
  if (const std::string reason = TextAt(entry, "error"); !reason.empty()) {
    ASSERT_FALSE(mesh.has_value());
    EXPECT_EQ(mesh.error().reason, reason) << mesh.error().message;
    return;
  }
  ASSERT_TRUE(mesh.has_value()) << mesh.error().message;
  std::vector<std::uint64_t> from_revisions;
  for (const Entry& attempt : ListAt(entry, "attempts")) {
    from_revisions.push_back(NumberAt(attempt, "from_revision"));
  }
  EXPECT_EQ(replay.from_revisions(), from_revisions);
  const std::string path = Scratch(TextAt(entry, "name"), "txt");
  ASSERT_TRUE(mesh->Save(path).has_value());
  EXPECT_EQ(ReadBytes(path), ReadBytes(FolderOfFiles() / TextAt(entry, "mesh")));
  std::string walls;
  for (const std::uint64_t bits : mesh->walls) walls += std::to_string(bits) + "\n";
  const std::string file = TextAt(entry, "walls");
  EXPECT_EQ(walls, file.empty() ? "" : ReadBytes(FolderOfFiles() / file));
  EXPECT_EQ(TerminationName(mesh->report.termination), TextAt(entry, "termination"));
  EXPECT_EQ(CertificateLevelName(mesh->report.certificate.level), TextAt(entry, "level"));
  const auto last = ReadStream(TextAt(ListAt(entry, "attempts").back(), "file")).back();
  EXPECT_EQ(MeshStateName(client::StatusOf(last.final()).state), TextAt(entry, "state"));
}

INSTANTIATE_TEST_SUITE_P(Each, Stream, ::testing::ValuesIn(Cases("streams.json")), NameOf);

class File : public ::testing::TestWithParam<Case> {};

TEST_P(File, HasTheseBytes) {
  const Mesh mesh = ReadTxt(TextAt(GetParam().entry, "mesh"));
  const auto expect = [&](const std::string& ending, const std::string& file) {
    const std::string path = Scratch(TextAt(GetParam().entry, "name"), ending);
    const Expected<void> saved = mesh.Save(path);
    ASSERT_TRUE(saved.has_value()) << saved.error().message;
    EXPECT_EQ(ReadBytes(path), ReadBytes(FolderOfFiles() / file)) << ending;
  };
  expect("txt", TextAt(GetParam().entry, "mesh"));
  for (const auto& [ending, file] : At(GetParam().entry, "files").struct_value().fields()) {
    expect(ending, file.string_value());
  }
  for (const Entry& ending : ListAt(GetParam().entry, "refused")) {
    EXPECT_FALSE(mesh.Save(Scratch("refused", ending.string_value())).has_value());
  }
}

INSTANTIATE_TEST_SUITE_P(Each, File, ::testing::ValuesIn(Cases("meshes.json")), NameOf);

std::string FromHex(const std::string& hex) {
  std::string bytes;
  for (size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  }
  return bytes;
}

void Judge(const Error& error, const Entry& entry) {
  const std::string fault = TextAt(entry, "fault");
  EXPECT_EQ(error.code, fault == "request"  ? ErrorCode::kRefused
                        : fault == "oracle" ? ErrorCode::kOracleFailed
                                            : ErrorCode::kServerFailed)
      << entry.ShortDebugString();
  EXPECT_EQ(error.reason, TextAt(entry, "reason"));
  EXPECT_EQ(cli::ExitStatusOf(error), static_cast<int>(NumberAt(entry, "exit_status")));
}

TEST(Errors, OfEveryStatusAreOfTheirClass) {
  const auto statuses = ListAt(ReadJson("errors.json"), "statuses");
  EXPECT_FALSE(statuses.empty());
  for (const Entry& entry : statuses) {
    const auto code = static_cast<grpc::StatusCode>(NumberAt(entry, "code"));
    const Error error = client::FromStatus(
        grpc::Status(code, TextAt(entry, "message"), FromHex(TextAt(entry, "details"))));
    Judge(error, entry);
    EXPECT_EQ(error.message.rfind(TextAt(entry, "message"), 0), 0u);
  }
}

TEST(Errors, OfEveryFailureAreOfTheirClass) {
  const auto failures = ListAt(ReadJson("errors.json"), "failures");
  EXPECT_FALSE(failures.empty());
  for (const Entry& entry : failures) {
    v1::Mesh mesh;
    mesh.mutable_report()->mutable_failure()->set_reason(TextAt(entry, "reason"));
    Judge(client::WhyFailed(mesh), entry);
  }
}

using Matrix = Eigen::MatrixXd;

double Distance(const Matrix& x, const Answer& a, Eigen::Index j) {
  return (x.col(j) - a.points.col(j)).norm();
}

void FindWithin(const Matrix& x, Answer* a, double limit) {
  a->found.assign(static_cast<size_t>(x.cols()), 1);
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    a->found[static_cast<size_t>(j)] = Distance(x, *a, j) < limit;
  }
}

// The other side of the tube.
void FarSide(const Matrix& x, Answer* a) {
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    if (Distance(x, *a, j) < 0.02) continue;
    const Eigen::Vector3d ring = Eigen::Vector3d(x(0, j), x(1, j), 0).normalized();
    a->points.col(j) = 2 * ring - a->points.col(j);
  }
}

void Lean(const Matrix& x, Answer* a) {
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    const Eigen::AngleAxisd turn(0.3 * Distance(x, *a, j), Eigen::Vector3d::UnitZ());
    a->points.col(j) = turn * Eigen::Vector3d(a->points.col(j));
  }
}

void Cube(const Matrix& x, Answer* a) {
  a->points = x.cwiseMax(-1).cwiseMin(1);
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    Eigen::Index axis = 0;
    if (x.col(j).cwiseAbs().maxCoeff(&axis) < 1) a->points(axis, j) = x(axis, j) < 0 ? -1 : 1;
  }
}

void SpoilPoints(const std::string& defect, int calls, const Matrix& x, Answer* a) {
  const Eigen::Index n = x.cols();
  if (defect == "raises") throw std::runtime_error("on purpose");
  if (defect == "one_row_short") a->points = Matrix(a->points.leftCols(n - 1));
  if (defect == "not_a_number") a->points(0, 0) = std::numeric_limits<double>::quiet_NaN();
  if (defect == "nothing_found") FindWithin(x, a, -1);
  if (defect == "found_nearby") FindWithin(x, a, 0.1);
  if (defect == "counts_calls") a->points.array() += 1e-3 * calls;
  if (defect == "alone_elsewhere" && n == 1) a->points.array() += 1e-3;
  if (defect == "half_way") a->points = (a->points + x) / 2;
  if (defect == "trembles") a->points.array() += 1e-8 * (1e6 * x.array()).sin();
  if (defect == "far_side") FarSide(x, a);
  if (defect == "leans") Lean(x, a);
  if (defect == "cube") Cube(x, a);
}

void SpoilBasis(const std::string& defect, Matrix* bases) {
  if (defect == "long_tangents") *bases *= 1.01;
  if (defect == "other_tangents") {
    const Matrix first = bases->topRows(2);
    bases->topRows(2) = Matrix(bases->bottomRows(2));
    bases->bottomRows(2) = first;
  }
}

void SpoilFlats(const std::string& defect, Oracle& good, const Matrix& centers, const Matrix& bases,
                Answer* a) {
  const auto n = static_cast<size_t>(centers.cols());
  if (defect == "no_flat_met") a->found.assign(n, 0);
  if (defect == "at_centre") a->points = centers;
  if (defect == "any_radius") {
    const Eigen::VectorXd far = Eigen::VectorXd::Constant(centers.cols(), 10);
    *a = good.IntersectFlat(centers, bases, far);
  }
  if (defect == "off_flat") {
    for (int i = 0; i < 3; ++i) a->points.row(i) += 0.01 * bases.row(2 * i);
  }
}

class Doctor : public ::testing::TestWithParam<Case> {
 protected:
  // One for all cases.
  static std::string Server() {
    static const auto server = client::EmbeddedServer::Start().value();
    return server->address();
  }
};

TEST_P(Doctor, FindsThis) {
  const std::string defect = TextAt(GetParam().entry, "defect");
  const bool torus = TextAt(GetParam().entry, "manifold") == "torus";
  const auto good = MakeManifold(torus ? "torus:1:0.4" : "sphere:2").value();
  SpoiledOracle oracle(*good);
  int calls = 0;
  oracle.on_closest = [&](const Matrix& x, Answer& a) { SpoilPoints(defect, ++calls, x, &a); };
  oracle.on_tangents = [&](Matrix& bases) { SpoilBasis(defect, &bases); };
  oracle.on_flat = [&](const Matrix& centers, const Matrix& bases, const Eigen::VectorXd&,
                       Answer& a) { SpoilFlats(defect, *good, centers, bases, &a); };
  oracle.on_sizes = [&](const Matrix& points, Eigen::VectorXd& sizes) {
    sizes.setConstant(defect == "negative_sizes" ? -1 : static_cast<double>(points.cols()));
  };
  oracle.intersects = !torus;
  oracle.has_sizes = defect == "negative_sizes" || defect == "sizes_of_batches";
  oracle.has_tangents = defect != "dimension_1" && defect != "no_tangents" && defect != "cube";
  oracle.k = defect == "dimension_3" ? 3 : defect == "dimension_1" ? 1 : 2;
  Eigen::VectorXd corner = Eigen::Vector3d::Constant(defect == "small_box" ? 1 : 1.1);
  if (torus && defect != "small_box" && defect != "cube") corner << 1.54, 1.54, 0.44;
  oracle.given_seeds.resize(3, 0);
  oracle.box = BoundingBox{-corner, corner};
  if (defect == "no_box") oracle.box.reset();

  CheckOptions options;
  if (At(GetParam().entry, "epsilon").has_number_value()) {
    options.epsilon = At(GetParam().entry, "epsilon").number_value();
  }
  options.connection.server = Server();
  const CheckReport report = Check(oracle, options).value();
  std::set<std::string> found, expected;
  for (const Finding& finding : report.findings) found.insert(finding.code);
  for (const char* const code : {"PIECES", "SPEED", "SLOW"}) found.erase(code);
  for (const Entry& code : ListAt(GetParam().entry, "finds")) expected.insert(code.string_value());
  EXPECT_EQ(found, expected) << ToText(report);
}

INSTANTIATE_TEST_SUITE_P(Each, Doctor, ::testing::ValuesIn(Cases("oracles.json")), NameOf);

}  // namespace
}  // namespace stellate::testing
