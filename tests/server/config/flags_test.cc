// The command line and the configuration file.

#include "server/config/flags.h"

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <type_traits>

#include "server/base/version.h"
#include "server/config/settings.h"

namespace stellate::server {
namespace {

class FlagsTest : public ::testing::Test {
 protected:
  FlagsTest() : file_(::testing::TempDir() + "stellated-" + std::to_string(getpid()) + ".toml") {}
  ~FlagsTest() override { std::filesystem::remove(file_); }

  void WriteFile(const std::string& text) { std::ofstream(file_) << text; }

  ParsedFlags Parse(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "stellated");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    ::testing::internal::CaptureStdout();
    ::testing::internal::CaptureStderr();
    ParsedFlags parsed = ParseFlags(static_cast<int>(argv.size()), argv.data());
    out_ = ::testing::internal::GetCapturedStdout();
    error_ = ::testing::internal::GetCapturedStderr();
    return parsed;
  }

  void ExpectRefused(const std::string& text, const std::string& word) {
    WriteFile(text);
    EXPECT_EQ(Parse({"--config", file_}).exit_status, 2) << text;
    EXPECT_NE(error_.find(word), std::string::npos) << error_;
  }

  const std::string file_;
  std::string out_, error_;
};

// No setting has its default.
Config Unlike(const Config& standard) {
  Config config = standard;
  for (const Setting& setting : Settings()) {
    std::visit(
        [&](auto field) {
          auto& value = config.*field;
          using T = std::decay_t<decltype(value)>;
          if constexpr (std::is_same_v<T, std::string>) {
            value = "/a path/to " + setting.Key();
          } else if constexpr (std::is_same_v<T, bool>) {
            value = !value;
          } else if constexpr (std::is_same_v<T, LogLevel>) {
            value = LogLevel::kDebug;
          } else if constexpr (std::is_same_v<T, LogFormat>) {
            value = LogFormat::kJson;
          } else if constexpr (std::is_same_v<T, double>) {
            value = (setting.least + setting.most) / 3;
          } else {
            value =
                static_cast<T>(setting.least) + (value == static_cast<T>(setting.least) ? 1 : 0);
          }
        },
        setting.field);
  }
  return config;
}

TEST_F(FlagsTest, WithoutFlagsTheDefaultsHold) {
  const ParsedFlags parsed = Parse({});
  EXPECT_FALSE(parsed.exit_status);
  EXPECT_EQ(parsed.flags.config, Config{});
  EXPECT_FALSE(parsed.flags.health_check);
}

TEST_F(FlagsTest, EverySettingSurvivesAConfigurationFile) {
  const Config config = Unlike({});
  EXPECT_NE(config, Config{});
  WriteFile(ToConfigFile(config));
  const ParsedFlags parsed = Parse({"--config", file_});
  EXPECT_FALSE(parsed.exit_status) << error_;
  EXPECT_EQ(parsed.flags.config, config);
}

TEST_F(FlagsTest, TheDefaultsSurviveToo) {
  WriteFile(ToConfigFile({}));
  const ParsedFlags parsed = Parse({"--config", file_});
  EXPECT_FALSE(parsed.exit_status) << error_;
  EXPECT_EQ(parsed.flags.config, Config{});
}

TEST_F(FlagsTest, PrintConfigPrintsWhatAFileAndFlagsMake) {
  WriteFile("max-meshes = 5\n");
  EXPECT_EQ(Parse({"--config", file_, "--max-workers", "6", "--print-config"}).exit_status, 0);
  Config config;
  config.max_meshes = 5;
  config.max_workers = 6;
  EXPECT_EQ(out_, ToConfigFile(config));
}

TEST_F(FlagsTest, TheCommandLineComesFirst) {
  WriteFile("# a comment\nmax-meshes = 5\nlog-format = \"json\"\ninsecure-listen = true\n");
  const ParsedFlags parsed = Parse({"--max-meshes", "7", "--config", file_});
  EXPECT_EQ(parsed.flags.config.max_meshes, 7u);
  EXPECT_EQ(parsed.flags.config.log_format, LogFormat::kJson);
  EXPECT_TRUE(parsed.flags.config.insecure_listen);
}

TEST_F(FlagsTest, MistakesInTheFileAreNamed) {
  ExpectRefused("max-meshs = 5\n", "\"max-meshs\"");
  ExpectRefused("max-meshes = many\n",
                "--max-meshes: is \"many\" but must be a whole number from 1 to 100000\n");
  ExpectRefused("max-meshes = 1e3\n", "is \"1e3\" but must be a whole number");
  ExpectRefused("max-meshes\n", "--max-meshes: ");
  ExpectRefused("hello-seconds = 10s\n",
                "is \"10s\" but must be a number from 0.001 to 31622400\n");
  ExpectRefused("[server]\nmax-meshes = 5\n", "there is a section [server]");
  ExpectRefused("log-level = loud\n", "loud");
  ExpectRefused("health-check = true\n", "health-check");
  EXPECT_EQ(Parse({"--config", file_ + ".none"}).exit_status, 2);
  EXPECT_NE(error_.find(file_ + ".none"), std::string::npos) << error_;
}

TEST_F(FlagsTest, MistakesOnTheCommandLineToo) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--no-such-flag"},
                                                    {"--max-meshes", "many"},
                                                    {"--max-meshes"},
                                                    {"--log-format", "xml"},
                                                    {"stray"}}) {
    EXPECT_EQ(Parse(arguments).exit_status, 2) << arguments[0];
    EXPECT_NE(error_, "");
  }
  EXPECT_EQ(Parse({"--max-meshes", "-3"}).exit_status, 2);
  EXPECT_NE(error_.find("\"-3\" but must be a whole number from 1 to"), std::string::npos)
      << error_;
}

TEST_F(FlagsTest, HelpHasEveryFlagOnce) {
  EXPECT_EQ(Parse({"--help"}).exit_status, 0);
  std::set<std::string> flags;
  for (const Setting& setting : Settings()) {
    EXPECT_TRUE(flags.insert(setting.flag).second) << setting.flag;
    EXPECT_NE(out_.find(std::string("  ") + setting.flag), std::string::npos) << setting.flag;
  }
}

TEST_F(FlagsTest, VersionNamesTheGrpcItRunsOn) {
  EXPECT_EQ(Parse({"--version"}).exit_status, 0);
  EXPECT_EQ(out_, std::string("stellated ") + Version() + " (gRPC " + grpc::Version() + ")\n");
}

TEST_F(FlagsTest, TheFileCanBeReadAgain) {
  WriteFile("max-meshes = 5\nmax-workers = 6\n");
  const std::vector<const char*> argv = {"stellated", "--config", file_.c_str(), "--max-workers",
                                         "9"};
  const int argc = static_cast<int>(argv.size());
  EXPECT_EQ(ParseFlags(argc, argv.data()).flags.config_file, file_);
  WriteFile("max-meshes = 8\nmax-workers = 7\n");
  const auto config = ReadSettingsAgain(argc, argv.data());
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->max_meshes, 8u);
  EXPECT_EQ(config->max_workers, 9u) << "the command line comes first then, too";

  for (const auto& [text, word] : {std::pair{"max-meshes = many\n", "\"many\" but must be"},
                                   {"max-meshs = 5\n", "no setting \"max-meshs\""},
                                   {"max-meshes\n", "max-meshes"}}) {
    WriteFile(text);
    const auto bad = ReadSettingsAgain(argc, argv.data());
    ASSERT_FALSE(bad) << text;
    EXPECT_NE(bad.error().message.find(word), std::string::npos) << bad.error().message;
  }
  std::filesystem::remove(file_);
  const auto gone = ReadSettingsAgain(argc, argv.data());
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().message.find(file_), std::string::npos) << gone.error().message;
}

TEST_F(FlagsTest, OnlyLiveSettingsAreTakenOver) {
  const Config next = Unlike({});
  Config config;
  const Changes changes = TakeOver(next, &config);
  EXPECT_EQ(changes.taken.size() + changes.at_next_start.size(), Settings().size());
  for (const Setting& setting : Settings()) {
    std::visit(
        [&](auto field) {
          EXPECT_EQ(config.*field == next.*field, setting.live) << setting.flag;
          EXPECT_EQ(config.*field == Config{}.*field, !setting.live) << setting.flag;
        },
        setting.field);
  }
  EXPECT_EQ(std::count(changes.taken.begin(), changes.taken.end(),
                       "max-meshes = " + std::to_string(next.max_meshes)),
            1);
  EXPECT_EQ(std::count(changes.at_next_start.begin(), changes.at_next_start.end(), "listen"), 1);
  EXPECT_TRUE(TakeOver(config, &config).taken.empty());
}

TEST_F(FlagsTest, EveryDefaultIsInItsRange) { EXPECT_TRUE(CheckRanges(Config{}).ok()); }

TEST_F(FlagsTest, EveryNumberHasARangeThatIsChecked) {
  for (const Setting& setting : Settings()) {
    for (const bool above : {true, false}) {
      Config config;
      const bool number = std::visit(
          [&](auto field) {
            auto& value = config.*field;
            using T = std::decay_t<decltype(value)>;
            if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
              if (!above && setting.least == 0 && std::is_unsigned_v<T>) return false;
              value = static_cast<T>(above ? setting.most : setting.least);
              value = above ? value + 1 : value - 1;
              return true;
            }
            return false;
          },
          setting.field);
      if (!number) continue;
      const core::Status status = CheckRanges(config);
      EXPECT_TRUE(status.message.starts_with(setting.flag)) << setting.flag << status.message;
    }
  }
}

}  // namespace
}  // namespace stellate::server
