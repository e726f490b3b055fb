// `stellate` with oracles that are programs in other languages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "program.h"
#include "stellate/command_oracle.h"
#include "stellate/download.h"

namespace stellate::testing {
namespace {

using ::testing::HasSubstr;

std::string Shipped(const std::string& name) { return PIPE_ORACLES "/" + name; }

// What the pipe's oracles are: no flats, no sizes, and a box of their own.
class AsThroughAPipe final : public Oracle {
 public:
  AsThroughAPipe(Oracle& oracle, BoundingBox box) : oracle_(oracle), box_(std::move(box)) {}
  int dimension() const override { return oracle_.dimension(); }
  int ambient_dimension() const override { return oracle_.ambient_dimension(); }
  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return oracle_.ClosestPoint(x); }
  bool has_tangent_basis() const override { return true; }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& x) override {
    return oracle_.TangentBasis(x);
  }
  std::optional<BoundingBox> bounding_box() const override { return box_; }

 private:
  Oracle& oracle_;
  const BoundingBox box_;
};

struct Shape {
  std::string file, manifold, box;
  double epsilon;
};
const Shape kShapes[] = {
    {"torus", "torus:1:0.4", "-1.5,-1.5,-0.5:1.5,1.5,0.5", 0.2},
    {"clifford", "clifford-torus", "-1,-1,-1,-1:1,1,1,1", 0.3},
};

class OracleCommand : public CommandLine {
 protected:
  OracleCommand() { std::filesystem::create_directories(folder_); }
  ~OracleCommand() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  std::string Script(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name)) << text;
    return Path(name);
  }
  // The mesh that a C++ oracle with the same answers gives.
  static Mesh Reference(const Shape& shape) {
    const auto manifold = Make(shape.manifold);
    AsThroughAPipe oracle(*manifold, *ParseBox(shape.box));
    const Expected<Mesh> mesh = MeshManifold(oracle, At(shape.epsilon));
    EXPECT_TRUE(mesh) << mesh.error().message;
    EXPECT_TRUE(mesh->report.certified());
    return mesh ? *mesh : Mesh();
  }
  // Formulas agree except in the last digits.
  static void ExpectSameMesh(const std::string& path, const Mesh& reference) {
    std::ifstream file(path);
    Eigen::Index k = 0, d = 0, vertices = 0, simplices = 0;
    file >> k >> d >> vertices >> simplices;
    ASSERT_EQ(vertices, reference.points.cols());
    ASSERT_EQ(simplices, reference.simplices.cols());
    Eigen::MatrixXd points(d, vertices);
    for (double& x : points.reshaped()) file >> x;
    SimplexMatrix ids(k + 1, simplices);
    for (std::uint32_t& id : ids.reshaped()) file >> id;
    ASSERT_TRUE(file);
    EXPECT_LT((points - reference.points).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_EQ(ids, reference.simplices);
  }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("stellate-command-" + std::to_string(getpid()));
};

struct Language {
  std::string name, ending, command;  // FILE is the program, OUT a file to build
};
void PrintTo(const Language& language, std::ostream* out) { *out << language.name; }

std::string FilledIn(const std::string& text, const std::string& what, const std::string& with) {
  std::ostringstream filled;
  size_t from = 0;
  for (size_t at = 0; (at = text.find(what, from)) != std::string::npos; from = at + what.size()) {
    filled << text.substr(from, at - from) << with;
  }
  filled << text.substr(from);
  return filled.str();
}

class InLanguages : public OracleCommand, public ::testing::WithParamInterface<Language> {};

TEST_P(InLanguages, MakeTheMeshOfACppOracle) {
  for (const Shape& shape : kShapes) {
    std::string command =
        FilledIn(GetParam().command, "FILE", Shipped(shape.file) + GetParam().ending);
    command = FilledIn(command, "OUT", Path(shape.file));
    const Result result = OnServer("mesh --oracle-command '" + command + "' --epsilon " +
                                   std::to_string(shape.epsilon) + " -q -o " + Path("mesh.txt"));
    ASSERT_EQ(result.status, 0) << result.output;
    ExpectSameMesh(Path("mesh.txt"), Reference(shape));
  }
}

INSTANTIATE_TEST_SUITE_P(OfDebian, InLanguages,
                         ::testing::Values(Language{"Perl", ".pl", "perl FILE"},
                                           Language{"Awk", ".awk", "mawk -W interactive -f FILE"},
                                           Language{"Shell", ".sh", "sh FILE"}),
                         [](const auto& tried) { return tried.param.name; });
// Run by `tests/run --languages`.
INSTANTIATE_TEST_SUITE_P(
    HeavyToolchains, InLanguages,
    ::testing::Values(Language{"Octave", ".m", "octave-cli -q FILE"},
                      Language{"R", ".R", "Rscript FILE"},
                      Language{"Fortran", ".f90", "gfortran -O2 -Wall FILE -o OUT && OUT"},
                      Language{"Rust", ".rs", "rustc -O --edition 2021 FILE -o OUT && OUT"}),
    [](const auto& tried) { return tried.param.name; });

TEST_F(OracleCommand, ProcessesShareAMeshAndChangeNothing) {
  const std::string command =
      "mesh --oracle-command 'perl " + Shipped("torus.pl") + "' --max-chunk 50 -e 0.2 -q";
  ASSERT_EQ(OnServer(command + " -o " + Path("one.txt")).status, 0);
  ASSERT_EQ(OnServer(command + " --oracle-processes 3 -o " + Path("three.txt")).status, 0);
  const auto content = [](const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  };
  EXPECT_EQ(content(Path("one.txt")), content(Path("three.txt")));
  EXPECT_NE(content(Path("one.txt")), "");
}

TEST_F(OracleCommand, DoctorExaminesCommands) {
  for (const std::string& command :
       {"perl " + Shipped("torus.pl"), "perl " + Shipped("clifford.pl"),
        "mawk -W interactive -f " + Shipped("clifford.awk")}) {
    const Result sound = Run("doctor --oracle-processes 2 --oracle-command '" + command + "'");
    EXPECT_EQ(sound.status, 0) << sound.output;
    EXPECT_THAT(sound.output, HasSubstr("The oracle keeps its contract"));
    EXPECT_THAT(sound.output, HasSubstr("points of M lie on 1 of its components"));
  }
  // Where it is asked for the closest point, it says the point itself.
  const std::string echo = Script("echo", R"(BEGIN { print "stellate-oracle 1 text"; fflush() }
/^closest/ { left = $2; next }
{ print; if (--left == 0) fflush() })");
  const Result lying =
      Run("doctor -k 2 -d 3 --box=-1,-1,-1:1,1,1 --oracle-command 'mawk -W interactive -f " + echo +
          "'");
  EXPECT_EQ(lying.status, 1);
  EXPECT_THAT(lying.output, HasSubstr("WRONG_DIMENSION"));
  EXPECT_EQ(Run("doctor --oracle-command no-such-program").status, 3);
}

// A sphere whose program ends as `when` says, with words.
std::string Dying(const std::string& when) {
  return R"(BEGIN { print "stellate-oracle 1 text k=2 d=3 seeds=1,0,0"; fflush() }
/^closest/ {
  ++batch
  if ()" +
         when + R"() { print "the solver diverged" > "/dev/stderr"; exit 5 }
  left = $2
  next
}
{
  r = sqrt($1 ^ 2 + $2 ^ 2 + $3 ^ 2)
  printf "%.17g %.17g %.17g\n", $1 / r, $2 / r, $3 / r
  if (--left == 0) fflush()
})";
}

TEST_F(OracleCommand, DoctorFindsThatItDiesIsSilentOrTalksNonsense) {
  const std::string greeting =
      R"(BEGIN { print "stellate-oracle 1 text k=2 d=3 seeds=1,0,0"; fflush() }
)";
  const std::pair<std::string, std::string> sick[] = {
      {Dying("1"), "the solver diverged"},
      {greeting + R"(/^closest/ { system("exec sleep 60") })", "written for 0.5 seconds"},
      {greeting + R"(!/^closest/ { print "a b c"; fflush() })", "has 'a'"}};
  for (const auto& [program, words] : sick) {
    const Result result =
        Run("doctor --oracle-silence 0.5 --oracle-command 'mawk -W interactive -f " +
            Script("sick", program) + "'");
    EXPECT_EQ(result.status, 1) << result.output;
    EXPECT_THAT(result.output, HasSubstr("error RAISED: closest_point failed on a batch"));
    EXPECT_THAT(result.output, HasSubstr(words));
    EXPECT_THAT(result.output, HasSubstr("Answer every query."));
    EXPECT_THAT(result.output, HasSubstr("The oracle breaks its contract: 1 error"));
  }
}

TEST_F(OracleCommand, UsageIsChecked) {
  const std::string torus = "--oracle-command 'perl " + Shipped("torus.pl") + "'";
  for (const auto& [arguments, words] : {
           std::pair{"mesh -e 0.2", "name a manifold, or give --solid or --oracle-command"},
           {"mesh torus -e 0.2 --box=-1,-1,-1:1,1,1", "--box requires --oracle-command"},
           {"mesh torus -e 0.2 TORUS", "excludes"},
           {"mesh -e 0.2 TORUS -k 1", "says k=2, and the options 1"},
           {"mesh -e 0.2 TORUS --box=1,1,1", "'1,1,1' is not a box"},
           {"mesh -e 0.2 TORUS --seeds=1,2", "need d = 3 coordinates"},
           {"mesh -e 0.2 TORUS --oracle-processes 0", "--oracle-processes"},
           {"mesh -e 0.2 TORUS --oracle-silence 0", "must be positive"},
           {"mesh -e 0.2 TORUS -o a.wkt", "wkt"},
           {"serve TORUS", "mesh is required"},
           {"declare torus", "--epsilon is required"},
           {"mesh torus", "or --epsilon auto, which takes a quarter of the reach"},
           {"mesh torus -o a.vtu", "--epsilon auto"},
           {"declare torus -e 0.3 --workers 2", "--workers"},
           {"declare torus -e 0.3 --label x --epsilon -1", "epsilon"},
       }) {
    const Result result = Run(FilledIn(arguments, "TORUS", torus));
    EXPECT_EQ(result.status, 2) << arguments << ": " << result.output;
    EXPECT_THAT(result.output, HasSubstr(words));
  }
}

TEST_F(OracleCommand, DeathNowAndThenIsSurvived) {
  const Result result = OnServer("mesh --oracle-command 'mawk -W interactive -f " +
                                 Script("dying", Dying("batch == 4")) + "' -e 0.3");
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("the solver diverged\nstellate: it is started again"));
}

TEST_F(OracleCommand, FailureInMidMeshIsToldInTheCommandsWords) {
  const Result result = OnServer("mesh --oracle-command 'mawk -W interactive -f " +
                                 Script("dying", Dying("$2 > 20")) + "' -e 0.3");
  EXPECT_EQ(result.status, 3) << result.output;
  EXPECT_THAT(result.output, HasSubstr("it closed its standard output"));
  EXPECT_THAT(result.output, HasSubstr("it ended with status 5\n"));
  EXPECT_THAT(result.output, HasSubstr("the solver diverged\n"));
}

// The command interrupts stellate, as a user would, in a batch that it never answers. By then it
// has answered more than seeds and what is asked around them, in however many batches it took.
TEST_F(OracleCommand, InterruptDeliversTheMeshSoFar) {
  const std::string interrupting = Script("interrupting", R"($| = 1;
print "stellate-oracle 1 text k=1 d=2 box=-2,-2:2,2\n";
while (my $line = <STDIN>) {
  my (undef, $n) = split " ", $line;
  if ($answered > 1000) { kill "INT", getppid; sleep 1000 }
  $answered += $n;
  for (1 .. $n) {
    my ($x, $y) = split " ", <STDIN>;
    my $r = sqrt($x * $x + $y * $y);
    printf "%.17g %.17g\n", $x / $r, $y / $r;
  }
})");
  const Result result = OnServer("mesh --oracle-command 'exec perl " + interrupting +
                                 "' -e 0.01 -o " + Path("so_far.txt"));
  EXPECT_EQ(result.status, 1) << result.output;
  EXPECT_THAT(result.output, HasSubstr("cancelled"));
  int k = 0, d = 0, vertices = 0;
  std::ifstream(Path("so_far.txt")) >> k >> d >> vertices;
  EXPECT_EQ(k, 1);
  EXPECT_GT(vertices, 0);
}

TEST_F(OracleCommand, ServesAMeshThatAnotherProgramDeclared) {
  const Shape& shape = kShapes[0];
  const std::string perl = "--oracle-command 'perl " + Shipped("torus.pl") + "'";
  const Result declared =
      OnServer("declare " + perl + " -e " + std::to_string(shape.epsilon) + " --label ours");
  ASSERT_EQ(declared.status, 0) << declared.output;
  const std::string name = declared.output.substr(0, declared.output.find('\n'));
  EXPECT_EQ(declared.output, name + "\n");
  const Result result = OnServer("serve " + perl + " --oracle-processes 2 " + name);
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_EQ(result.output, name + " SUCCEEDED\n");
  DownloadOptions options;
  options.connection.server = Server();
  const Expected<Mesh> made = DownloadMesh(name, options);
  ASSERT_TRUE(made) << made.error().message;
  ASSERT_TRUE(made->Save(Path("served.txt")));
  ExpectSameMesh(Path("served.txt"), Reference(shape));
  // The catalogue's serve, too; and a name that is not there is refused.
  EXPECT_EQ(OnServer("serve " + name + " torus").status, 0);
  EXPECT_EQ(OnServer("serve meshes/00000000000000000000000000000000 torus").status, 2);
}

}  // namespace
}  // namespace stellate::testing
