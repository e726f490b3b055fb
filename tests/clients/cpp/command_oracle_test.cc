// Oracles that are programs: what they may do, and everything that they may do wrong.
#include "stellate/command_oracle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "stellate/catalogue.h"

namespace stellate {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains, ::testing::Each, ::testing::HasSubstr, ::testing::IsEmpty,
    ::testing::Not, ::testing::StartsWith;

constexpr const char* kTorus = "k=2 d=3 box=-1.5,-1.5,-0.5:1.5,1.5,0.5";

class CommandOracle : public ::testing::Test {
 protected:
  CommandOracle() {
    fs::create_directories(folder_);
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "no children before";
    descriptors_ = Descriptors();
  }
  // Whatever happened, nothing is left of it.
  ~CommandOracle() override {
    EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "no process is left, not even as a zombie";
    EXPECT_EQ(errno, ECHILD);
    EXPECT_EQ(Descriptors(), descriptors_);
    fs::remove_all(folder_);
  }

  static std::ptrdiff_t Descriptors() {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  }
  static std::string Shipped(const std::string& name) { return PIPE_ORACLES "/" + name; }

  // A command that runs the script.
  std::string Script(const std::string& interpreter, const std::string& text) {
    const std::string path = (folder_ / ("script" + std::to_string(scripts_++))).string();
    std::ofstream(path) << text;
    return interpreter + " " + path;
  }
  // One that greets with `words` and then has `act` for each batch of $n points of R^3, $bytes.
  std::string Perl(const std::string& words, const std::string& act) {
    return Script("perl", "$| = 1; binmode STDIN; binmode STDOUT;\nprint 'stellate-oracle 1 " +
                              words +
                              "', \"\\n\";\nwhile (read(STDIN, my $head, 16) == 16) {\n"
                              "  my (undef, $n) = unpack 'L4', $head;\n"
                              "  read STDIN, my $bytes, 24 * $n;\n" +
                              act + "\n}\n");
  }

  static CommandOptions Options(const std::string& command) {
    CommandOptions options;
    options.command = command;
    options.silence_seconds = 30;  // of a test that would wait
    return options;
  }
  static std::unique_ptr<Oracle> Start(const CommandOptions& options) {
    auto oracle = StartCommand(options);
    EXPECT_TRUE(oracle) << oracle.error().message;
    return oracle ? std::move(*oracle) : nullptr;
  }
  // What is said of a command that fails when it starts or is asked for the closest points of 3.
  static std::string ErrorOf(const CommandOptions& options) {
    auto oracle = StartCommand(options);
    if (!oracle) return oracle.error().message;
    try {
      (*oracle)->ClosestPoint(Eigen::MatrixXd::Constant((*oracle)->ambient_dimension(), 3, 0.7));
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  }

  const fs::path folder_ =
      fs::temp_directory_path() / ("stellate-pipe-" + std::to_string(getpid()));
  int scripts_ = 0;
  std::ptrdiff_t descriptors_ = 0;
};

// Far more than pipes hold, in both directions at once: awk answers while it is still asked.
TEST_F(CommandOracle, LargeBatchesAreAnsweredExactly) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(3, 40'000);
  const Answer right = torus->ClosestPoint(x);
  for (const std::string& command :
       {"perl " + Shipped("torus.pl"), "mawk -W interactive -f " + Shipped("torus.awk")}) {
    const auto oracle = Start(Options(command));
    ASSERT_NE(oracle, nullptr);
    const Answer answer = oracle->ClosestPoint(x);
    EXPECT_LT((answer.points - right.points).cwiseAbs().maxCoeff(), 1e-14) << command;
  }
}

// At points that it found itself, a command may round them otherwise.
TEST_F(CommandOracle, TangentsComeAlongFromTheFirst) {
  const auto oracle = Start(Options("perl " + Shipped("torus.pl")));
  ASSERT_NE(oracle, nullptr);
  EXPECT_TRUE(oracle->has_tangent_basis());
  EXPECT_FALSE(oracle->has_intersect_flat() || oracle->has_local_size());
  EXPECT_EQ(oracle->bounding_box()->upper, Eigen::Vector3d(1.5, 1.5, 0.5));
  const Answer first = oracle->ClosestPoint(Eigen::MatrixXd::Random(3, 7));
  EXPECT_EQ(first.tangents.cols(), 7);
  const Eigen::MatrixXd& points = first.points;
  const Eigen::MatrixXd tangents = oracle->TangentBasis(points);
  EXPECT_LT((tangents - first.tangents).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_EQ(oracle->ClosestPoint(points).tangents, tangents);
  EXPECT_EQ(oracle->TangentBasis(Eigen::MatrixXd(3, 0)).cols(), 0);
  // On the axis: no closest point, and that is an answer, but not for tangents.
  EXPECT_FALSE(oracle->ClosestPoint(Eigen::Vector3d::Zero()).IsFound(0));
  EXPECT_THROW(oracle->TangentBasis(Eigen::Vector3d::Zero()), std::runtime_error);
}

TEST_F(CommandOracle, FlatsAndSizesGoThroughBothFramings) {
  // The flat's answer is its centre, radius and a number of its basis.
  const std::string greeting = "k=1 d=2 flats=1 sizes=1 seeds=1,0 about=as it is told";
  const std::string binary = Script("perl", R"($| = 1; binmode STDIN; binmode STDOUT;
print "stellate-oracle 1 binary )" + greeting + R"(\n";
while (read(STDIN, my $head, 16) == 16) {
  my ($kind, $n, $flags) = unpack "L4", $head;
  read STDIN, my $points, 16 * $n;
  my ($bases, $radii) = ("", "");
  read STDIN, $bases, 16 * $n if $kind == 2;
  read STDIN, $radii, 8 * $n if $kind == 2;
  print pack("L2", $n, $flags & 2), $kind == 2 ? $bases : $points, $flags & 2 ? ($kind == 2 ? $radii : pack("d*", (3) x $n)) : "";
})");
  const std::string text =
      Script("mawk -W interactive -f",
             R"(BEGIN { print "stellate-oracle 1 text )" + greeting + R"("; fflush() }
NF == 4 && /^[a-z]/ { kind = $1; left = $2; next }
{ if (kind == "flat") print $3, $4, $5; else print $1, $2, 3; if (--left == 0) fflush() })");
  for (const std::string& command : {binary, text}) {
    const auto oracle = Start(Options(command));
    ASSERT_NE(oracle, nullptr);
    const Eigen::Matrix2d x{{1, 2}, {3, 4}}, bases{{0.25, 0.5}, {0.75, 1}};
    EXPECT_EQ(oracle->about(), "as it is told");
    EXPECT_EQ(oracle->LocalSize(x), Eigen::Vector2d(3, 3)) << command;
    const Answer answer = oracle->IntersectFlat(x, bases, Eigen::Vector2d(5, 6));
    EXPECT_EQ(answer.points, bases) << command;
    EXPECT_EQ(answer.sizes, Eigen::Vector2d(5, 6)) << command;
  }
}

TEST_F(CommandOracle, WhatGoesWrongIsSaidInWords) {
  const std::string hello = "echo stellate-oracle 1 binary " + std::string(kTorus) + "; ";
  const std::string text = "echo stellate-oracle 1 text " + std::string(kTorus) + "; ";
  const std::vector<std::pair<std::string, std::string>> tried = {
      {"no-such-program --quiet", "status 127"},
      {"no-such-program --quiet", "no-such-program: not found"},
      {"true", "at its first line: it closed its standard output"},
      {"echo GNU Octave; cat", "is 'GNU Octave'; if that is a banner"},
      {hello + "exit 3", "in a batch of 3 closest points: it closed its standard output"},
      {hello + "exit 3", "it ended with status 3"},
      {hello + "echo out of memory >&2; kill -9 $$",
       "signal 9 (Killed)\nits standard error ends:\nout of memory"},
      {hello + "exec >&-; sleep 1000", "it closed its standard output, after it took"},
      {hello + "head -c 88 >&2; yes", "these are 'y\\x0ay\\x0a"},
      {hello + "head -c 88 >&2; printf '\\2\\0\\0\\0\\0\\0\\0\\0'; cat",
       "it answers 2 rows and was asked 3"},
      {text + "cat", "row 1 of 3 has 'closest' for a number"},
      {text + "read -r line; echo 1 2 3; echo 1 2 3; echo 1 nan 3; cat >&2",
       "row 3 of 3 has a point that is not finite"},
      {text + "read -r line; printf '1 2 3\\n1 2 3\\n1 2 3\\n4'; cat >&2",
       "it wrote more than it was asked for: '4'"},
      {text + "read -r line; echo error no licence for the solver; cat >&2",
       "it says: error no licence for the solver"},
      {Perl(std::string("binary ") + kTorus, "print pack('L2', 5, 8), 'weird';"), "it says: weird"},
      {Perl(std::string("binary ") + kTorus,
            "print pack('L2', $n, 0), substr($bytes, 8), pack('d', 9**9**9);"),
       "row 3 of 3 has a point that is not finite"},
      {Perl(std::string("binary ") + kTorus,
            "print pack('L2', $n, 0), substr($bytes, 8); die 'half way';"),
       "half way at "},
  };
  for (const auto& [command, words] : tried) {
    const std::string error = ErrorOf(Options(command));
    EXPECT_THAT(error, HasSubstr(words)) << command;
    EXPECT_THAT(error, HasSubstr("the oracle command '" + command.substr(0, 20))) << command;
  }
}

// The question does not fit into a pipe; nor does SIGPIPE end the test.
TEST_F(CommandOracle, CommandThatStopsReadingIsNamed) {
  const auto oracle = Start(Options("echo stellate-oracle 1 binary " + std::string(kTorus) +
                                    "; exec <&-; exec sleep 1000"));
  ASSERT_NE(oracle, nullptr);
  try {
    oracle->ClosestPoint(Eigen::MatrixXd::Ones(3, 100'000));
    ADD_FAILURE();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("it closed its standard input, after it took"));
  }
}

TEST_F(CommandOracle, SilenceIsNotBorneForEver) {
  CommandOptions options = Options("cat");
  options.start_seconds = 0.2;
  EXPECT_THAT(ErrorOf(options), HasSubstr("its first line never came"));
  options.start_seconds = 60;
  options.silence_seconds = 0.2;
  options.command = "echo stellate-oracle 1 text " + std::string(kTorus) + "; exec sleep 1000";
  EXPECT_THAT(
      ErrorOf(options),
      HasSubstr("it has neither read nor written for 0.2 seconds, after it took 50 of 50 bytes"));
}

TEST_F(CommandOracle, WhatKeepsWaitingIsTold) {
  const auto told_of = [](CommandOptions options) {
    std::vector<std::string> told;
    options.on_waiting = [&told](const std::string& what) { told.push_back(what); };
    options.unremarked_seconds = 0.01;
    options.silence_seconds = 0.3;
    EXPECT_THAT(ErrorOf(options), HasSubstr("seconds"));
    return told;
  };
  CommandOptions silent = Options("exec sleep 1000");
  silent.start_seconds = 0.3;
  const std::vector<std::string> at_first = told_of(silent);
  EXPECT_LE(std::ssize(at_first), 5);  // at .01, .02, .04, ... of .3 seconds
  EXPECT_THAT(at_first, Each(StartsWith("waiting for the oracle command's first line, ")));
  EXPECT_THAT(at_first, Not(IsEmpty()));
  const auto later =
      told_of(Options("echo stellate-oracle 1 text " + std::string(kTorus) + "; exec sleep 1000"));
  EXPECT_THAT(later, Contains("waiting for the oracle command's first answer, to 3 closest points, "
                              "0 s"));
}

// What has no end of line would be waited for, whatever it was.
TEST_F(CommandOracle, AFirstLineThatCanBeNoneIsRefusedAsItComes) {
  EXPECT_THAT(ErrorOf(Options("printf Welcome; exec sleep 1000")), HasSubstr("is 'Welcome'"));
  EXPECT_TRUE(StartCommand(Options("printf '  stellate-'; sleep 0.1; printf 'oracle 1 text " +
                                   std::string(kTorus) + "\\n'; exec cat >/dev/null")));
}

TEST_F(CommandOracle, OptionsAndCommandHaveToAgree) {
  const std::string cat = "; exec cat";
  const auto refused = [&](CommandOptions options, const std::string& words) {
    const auto oracle = StartCommand(options);
    ASSERT_FALSE(oracle);
    EXPECT_EQ(oracle.error().code, ErrorCode::kRefused);
    EXPECT_THAT(oracle.error().message, HasSubstr(words));
  };
  CommandOptions options = Options("echo stellate-oracle 1 text" + cat);
  refused(options, "what k is");
  options.dimension = 1;
  refused(options, "what d is");
  options.ambient_dimension = 1;
  refused(options, "has to be at least 1 and less than d = 1");
  options.ambient_dimension = 2;
  refused(options, "neither box nor seeds");
  options.seeds = Eigen::Vector3d(1, 0, 0);
  refused(options, "need d = 2 coordinates");
  options.seeds = Eigen::Vector2d(1, 0);
  EXPECT_NE(Start(options), nullptr);
  options.command = "echo stellate-oracle 1 text k=2" + cat;
  refused(options, "says k=2, and the options 1");
  options.command = "";
  refused(options, "empty");
  options.command = "cat";
  options.processes = 0;
  refused(options, "number of processes");
}

TEST_F(CommandOracle, ProcessThatEndsAfterAnAnswerIsStartedAgain) {
  // Each answers a single batch. $0 is the status that it ends with.
  const auto once = [this](const std::string& end) {
    return Perl(std::string("binary ") + kTorus, "print pack('L2', $n, 0), $bytes; " + end);
  };
  const Eigen::MatrixXd x = Eigen::MatrixXd::Random(3, 5);
  std::vector<std::string> told;
  CommandOptions options = Options(once("exit 0;"));
  options.on_restart = [&told](const std::string& how) { told.push_back(how); };
  const auto orderly = Start(options);
  ASSERT_NE(orderly, nullptr);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(orderly->ClosestPoint(x).points, x);
  EXPECT_TRUE(told.empty()) << told.front();
  options.command = once("die 'leaks too much';");
  const auto dying = Start(options);
  ASSERT_NE(dying, nullptr);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(dying->ClosestPoint(x).points, x);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_THAT(told[0], HasSubstr("leaks too much"));
}

TEST_F(CommandOracle, BatchThatKillsTwiceIsAnError) {
  int restarts = 0;
  CommandOptions options =
      Options(Perl(std::string("binary ") + kTorus,
                   "die 'not four!' if $n == 4; print pack('L2', $n, 0), $bytes;"));
  options.on_restart = [&restarts](const std::string&) { ++restarts; };
  const auto oracle = Start(options);
  ASSERT_NE(oracle, nullptr);
  oracle->ClosestPoint(Eigen::MatrixXd::Random(3, 3));
  EXPECT_THROW(oracle->ClosestPoint(Eigen::MatrixXd::Random(3, 4)), std::runtime_error);
  EXPECT_EQ(restarts, 1);
  EXPECT_THROW(oracle->ClosestPoint(Eigen::MatrixXd::Random(3, 3)), std::runtime_error)
      << "an oracle that failed stays failed";
}

TEST_F(CommandOracle, AllProcessesHaveTheirTurn) {
  CommandOptions options = Options(Perl("binary k=2 d=3 sizes=1 seeds=1,0,0",
                                        "print pack('L2', $n, 2), $bytes, pack('d*', ($$) x $n);"));
  options.processes = 3;
  const auto oracle = Start(options);
  ASSERT_NE(oracle, nullptr);
  std::set<double> processes;
  for (int i = 0; i < 3; ++i) processes.insert(oracle->LocalSize(Eigen::Vector3d::Ones())[0]);
  EXPECT_EQ(processes.size(), 3u);
  // And more threads than processes, each with its own question.
  std::vector<std::thread> threads;
  std::atomic<int> right = 0;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&oracle, &right, t] {
      const Eigen::MatrixXd x = Eigen::MatrixXd::Constant(3, 1 + t, t);
      for (int i = 0; i < 20; ++i) right += oracle->ClosestPoint(x).points == x ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 160);
}

// Whether a process does something still; a zombie that somebody else has to bury does not.
bool Runs(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string number, name, state;
  return file >> number >> name >> state && state != "Z" && state != "X";
}

TEST_F(CommandOracle, NothingOutlivesTheOracle) {
  // Neither the end of its input nor SIGTERM moves it, and it has a child of its own.
  const std::string pids = (folder_ / "pids").string();
  auto oracle =
      Start(Options("exec " + Script("sh", "trap '' TERM\nsleep 1000 &\necho $! $$ > " + pids +
                                               "\necho stellate-oracle 1 text " + kTorus +
                                               "\nwhile :; do sleep 1; done\n")));
  ASSERT_NE(oracle, nullptr);
  pid_t grandchild = 0, child = 0;
  std::ifstream(pids) >> grandchild >> child;
  EXPECT_TRUE(Runs(grandchild) && Runs(child));
  EXPECT_EQ(getpgid(grandchild), child);
  EXPECT_NE(child, getpgrp()) << "a terminal's Ctrl-C is not the command's";
  oracle.reset();
  // Killed; that the system buries it takes a moment, and a test that hangs here has failed.
  while (Runs(child) || Runs(grandchild)) std::this_thread::yield();
}

TEST_F(CommandOracle, CommandsMayFinishTheirWorkWhenTheirInputEnds) {
  const std::string farewell = (folder_ / "farewell").string();
  Start(Options(Script("sh", "echo stellate-oracle 1 text " + std::string(kTorus) +
                                 "\ncat\nhead -c 300000 /dev/zero\necho done > " + farewell)));
  EXPECT_TRUE(fs::exists(farewell));
}

TEST_F(CommandOracle, StopEndsABatchThatIsNotAnswered) {
  std::stop_source source;
  CommandOptions options =
      Options("echo stellate-oracle 1 text " + std::string(kTorus) + "; exec sleep 1000");
  options.stop = source.get_token();
  const auto oracle = Start(options);
  ASSERT_NE(oracle, nullptr);
  std::thread stopper([&source] { source.request_stop(); });
  try {
    oracle->ClosestPoint(Eigen::Vector3d::Ones());
    ADD_FAILURE();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("asked to stop"));
  }
  stopper.join();
}

}  // namespace
}  // namespace stellate
