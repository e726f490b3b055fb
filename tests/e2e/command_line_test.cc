// The `stellate` program: what it prints, writes and exits with.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>

#include "program.h"

namespace stellate::testing {
namespace {

TEST_F(CommandLine, CertifiedMeshExitsZeroAndWritesItsFiles) {
  const auto directory =
      std::filesystem::temp_directory_path() / ("stellate-cli-" + std::to_string(getpid()));
  std::filesystem::create_directories(directory);
  const std::string txt = (directory / "a.txt").string(), vtu = (directory / "a.vtu").string();
  const Result result = OnServer("mesh torus --epsilon 0.2 -o " + txt + " -o " + vtu +
                                 " --report " + (directory / "a.json").string());
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_NE(result.output.find("CERTIFIED"), std::string::npos) << result.output;
  EXPECT_NE(result.output.find("Euler characteristic 0"), std::string::npos);
  EXPECT_EQ(result.output.find('\r'), std::string::npos) << "no progress bar off a terminal";
  std::ifstream file(txt);
  int k = 0, d = 0, vertices = 0, simplices = 0;
  file >> k >> d >> vertices >> simplices;
  EXPECT_EQ(k, 2);
  EXPECT_EQ(d, 3);
  EXPECT_EQ(simplices, 2 * vertices);  // a torus
  EXPECT_GT(std::filesystem::file_size(vtu), 0u);
  std::ifstream report(directory / "a.json");
  std::string json;
  std::getline(report, json);
  EXPECT_EQ(json.rfind("{\"termination\": \"CONVERGED\", \"epsilon\": 0.2", 0), 0u) << json;
  std::filesystem::remove_all(directory);
}

TEST_F(CommandLine, JsonAndQuietSayWhatTheyShould) {
  const Result json = OnServer("mesh circle:4 -e 0.3 --json");
  EXPECT_EQ(json.status, 0);
  EXPECT_EQ(json.output.front(), '{');
  EXPECT_NE(json.output.find("\"certified\": true"), std::string::npos) << json.output;
  const Result quiet = OnServer("mesh circle:4 -e 0.3 --quiet");
  EXPECT_EQ(quiet.status, 0);
  EXPECT_EQ(quiet.output, "");
}

TEST_F(CommandLine, ClosestPointsAloneWillDo) {
  EXPECT_EQ(OnServer("mesh torus -e 0.2 --closest-point-only -q").status, 0);
}

TEST_F(CommandLine, AutomaticEpsilonIsAQuarterOfTheReach) {
  const Result result = OnServer("mesh torus:1000:400 --epsilon auto");
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_EQ(result.output.rfind("epsilon 100, a quarter of the reach, about 4", 0), 0u)
      << result.output;
  EXPECT_NE(result.output.find("      epsilon  100, a quarter of"), std::string::npos)
      << result.output;
  const Result wrong = OnServer("mesh torus --epsilon aut");
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.output.find("has to be a length or auto, and is 'aut'"), std::string::npos)
      << wrong.output;
}

TEST_F(CommandLine, UncertifiedMeshExitsOne) {
  const Result result = OnServer("mesh torus --epsilon 0.2 --max-vertices 50");
  EXPECT_EQ(result.status, 1) << result.output;
  EXPECT_NE(result.output.find("NOT CERTIFIED"), std::string::npos) << result.output;
}

TEST_F(CommandLine, UsageAndRefusalsExitTwo) {
  for (const std::string arguments :
       {"", "frobnicate", "mesh", "mesh torus", "mesh torus --epsilon", "mesh torus -e x",
        "mesh torus -e -inf", "mesh torus -e nan", "mesh klein -e 1",
        "mesh torus -e 0.1 --no-such-flag"}) {
    const Result result = Run(arguments);
    EXPECT_EQ(result.status, 2) << arguments << ": " << result.output;
    EXPECT_NE(result.output, "");
  }
  const Result refused = OnServer("mesh torus --epsilon -1");
  EXPECT_EQ(refused.status, 2);
  EXPECT_NE(refused.output.find("INVALID_ARGUMENT: "), std::string::npos) << refused.output;
  EXPECT_NE(refused.output.find("-1"), std::string::npos) << refused.output;
  EXPECT_EQ(OnServer("mesh torus -e 0.2 -q -o /no/such/place.txt").status, 2);
}

TEST_F(CommandLine, NamesWhatItDoesNotKnow) {
  const Result misspelt = Run("msh torus -e 0.2");
  EXPECT_EQ(misspelt.status, 2);
  EXPECT_EQ(misspelt.output,
            "stellate: there is no command 'msh'; stellate --help shows all of them\n");
  const Result file = Run("view torus.vtu");
  EXPECT_EQ(file.status, 2);
  EXPECT_NE(file.output.find("'torus.vtu' is not the name of a mesh on a server"),
            std::string::npos)
      << file.output;
}

TEST_F(CommandLine, RefusalsNameTheFlagsThatWereTyped) {
  const std::pair<const char*, const char*> refused[] = {
      {"mesh torus -e 0.2 --shape good", "--shape is for k = 3"},
      {"mesh torus -e 0.2 --advance-step 0.1",
       "--advance-step is 0.1 but must be at least epsilon"},
      {"mesh torus -e 0.2 --answer 9 --busy 3", "--busy is 3 but must be --answer (9)"},
      {"mesh torus -e 0.2 --radius-edge 0.1", "--radius-edge (rho0) is 0.1"},
      {"mesh torus -e 0.2 --reach -1", "--reach is -1"}};
  for (const auto& [arguments, words] : refused) {
    const Result result = OnServer(arguments);
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_NE(result.output.find(words), std::string::npos) << arguments << ": " << result.output;
  }
}

// With a server that is not there: 2, and not 3, says that it was not even looked for.
TEST_F(CommandLine, FilesAreRefusedBeforeMeshing) {
  for (const std::string arguments :
       {"torus -e 0.2 -o a.wkt", "so3 -e 0.4 -o a.txt -o a.stl", "circle:4 -e 0.3 -o a.msh",
        "torus -e 0.2 -o /no/such/a.txt"}) {
    const Result result = Run("mesh " + arguments + " --server unix:/nowhere/at/all");
    EXPECT_EQ(result.status, 2) << arguments << ": " << result.output;
  }
  EXPECT_FALSE(std::filesystem::exists("a.txt"));
}

TEST_F(CommandLine, ServerThatIsNotThereExitsThree) {
  EXPECT_EQ(Run("mesh torus -e 0.2 --server unix:/nowhere/at/all").status, 3);
  EXPECT_EQ(Run("health --server unix:/nowhere/at/all").status, 3);
}

TEST_F(CommandLine, HealthListVersionAndHelpExitZero) {
  const Result health = OnServer("health");
  EXPECT_EQ(health.status, 0) << health.output;
  EXPECT_NE(health.output.find(": serving"), std::string::npos) << health.output;
  const Result list = Run("list");
  EXPECT_EQ(list.status, 0);
  for (const CatalogueEntry& entry : ListManifolds()) {
    EXPECT_NE(list.output.find(entry.syntax), std::string::npos) << entry.syntax;
  }
  EXPECT_EQ(Run("--version").output.rfind("stellate ", 0), 0u);
  EXPECT_EQ(Run("--version").status, 0);
  EXPECT_EQ(Run("mesh --help").status, 0);
}

TEST_F(CommandLine, DownloadRefusesWhatItCannotFetch) {
  const std::string none = "meshes/00000000000000000000000000000000";
  const Result result = OnServer("download " + none + " -o a.txt");
  EXPECT_EQ(result.status, 2);
  EXPECT_NE(result.output.find("MESH_NOT_FOUND"), std::string::npos) << result.output;
  EXPECT_EQ(OnServer("download " + none).status, 2) << "nowhere to write it";
  EXPECT_EQ(OnServer("download " + none + " -o a.txt --wait --unfinished").status, 2);
  EXPECT_EQ(Run("download " + none + " -o a.txt --server unix:/nowhere/at/all").status, 3);
}

TEST_F(CommandLine, DoctorFindsTheCatalogueInGoodHealth) {
  const Result good = Run("doctor torus:1:0.4 --epsilon 0.3");
  EXPECT_EQ(good.status, 0) << good.output;
  EXPECT_NE(good.output.find("keeps its contract"), std::string::npos) << good.output;
  EXPECT_NE(good.output.find("COARSE_EPSILON"), std::string::npos) << good.output;
  EXPECT_EQ(Run("doctor klein").status, 2);
  const Result asJson = OnServer("doctor torus:1:0.4 --json");
  EXPECT_EQ(asJson.status, 0) << asJson.output;
  for (const char* const words :
       {"\"ok\": true", "\"code\": \"REACH\"", "\"epsilon\": 0.1", "\"advised\": 0."})
    EXPECT_NE(asJson.output.find(words), std::string::npos) << asJson.output;
  EXPECT_EQ(OnServer("doctor torus --epsilon -1").status, 2);
  EXPECT_EQ(Run("doctor torus --server unix:/nowhere/at/all").status, 3);
}

TEST_F(CommandLine, TopShowsTheMeshesOnce) {
  const auto torus = Make("torus:1:0.4");
  std::string during;
  MeshOptions options = At(0.1);
  options.label = "seen at the top";
  options.on_progress = [&during](const Progress&) {
    if (during.empty()) during = OnServer("top --once --sort vertices").output;
  };
  ASSERT_TRUE(MeshManifold(*torus, options).has_value());
  EXPECT_NE(during.find("seen at the top"), std::string::npos) << during;
  EXPECT_NE(during.find("VERTICES"), std::string::npos) << during;
  EXPECT_EQ(during.find('\033'), std::string::npos) << "plain off a terminal";
  const Result after = OnServer("top --once");
  EXPECT_EQ(after.status, 0);
  EXPECT_EQ(after.output.find("seen at the top"), std::string::npos) << after.output;
  EXPECT_EQ(Run("top --once --server unix:/nowhere/at/all").status, 3);
  EXPECT_EQ(Run("top --sort beauty").status, 2);
}

TEST_F(CommandLine, CtrlCEndsItCleanly) {
  // A mesh too large to finish, in a process group of its own as in a terminal's foreground.
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const std::string program = Program();
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    dup2(ends[1], STDOUT_FILENO);
    close(ends[0]);
    close(ends[1]);
    execl(program.c_str(), program.c_str(), "mesh", "torus", "-e", "0.003", nullptr);
    _exit(127);
  }
  close(ends[1]);
  setpgid(child, child);
  // Its own server is its child: once that is there, the mesh is about to start.
  const std::string children =
      "/proc/" + std::to_string(child) + "/task/" + std::to_string(child) + "/children";
  for (std::string list; list.empty();) {
    std::ifstream file(children);
    list.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    ASSERT_EQ(waitpid(child, nullptr, WNOHANG), 0) << "it ended by itself";
    usleep(10'000);
  }
  usleep(500'000);  // well into the mesh; right at the start would do as well
  kill(-child, SIGINT);
  std::string output;
  std::array<char, 4096> buffer;
  for (ssize_t count; (count = read(ends[0], buffer.data(), buffer.size())) > 0;) {
    output.append(buffer.data(), static_cast<size_t>(count));
  }
  close(ends[0]);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status)) << "a signal ended it";
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_NE(output.find("cancelled"), std::string::npos) << output;
}

}  // namespace
}  // namespace stellate::testing
