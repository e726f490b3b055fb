#include "server/base/log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

namespace stellate::server {
namespace {

TEST(Log, JsonStringsEscapeWhatWouldBreakThem) {
  EXPECT_EQ(JsonString("plain"), "\"plain\"");
  EXPECT_EQ(JsonString("a\"b\\c"), "\"a\\\"b\\\\c\"");
  EXPECT_EQ(JsonString("line\nend\x7f"), "\"line\\u000aend\\u007f\"");
  EXPECT_EQ(JsonString("ε"), "\"ε\"");
}

TEST(Log, LinesNameTheMeshAndTheRound) {
  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kInfo, LogFormat::kText);
  Log(LogLevel::kInfo, {"meshes/ab", 7}, "a client's\nwords\x7f\xc2\x9b[2J\x1b[2J\xce\xb5");
  Log(LogLevel::kDebug, {}, "not shown");
  StartLogging(LogLevel::kWarning, LogFormat::kJson);
  Log(LogLevel::kWarning, {"meshes/cd", 8}, "say \"so\"");
  const std::string text = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("[meshes/ab round 7] a client's words  [2J [2J\xce\xb5\n"), std::string::npos)
      << text;
  EXPECT_EQ(text.find("not shown"), std::string::npos);
  EXPECT_NE(text.find(R"("mesh":"meshes/cd","round":8,"message":"say \"so\""})"), std::string::npos)
      << text;
}

TEST(Log, FieldsAreForPrograms) {
  const auto fields = LogFields()
                          .Add("state", "FAILED")
                          .Add("label", "")
                          .Add("words", std::string("a \"b\"\n"))
                          .Add("tricky", "a=b")
                          .Add("certified", false)
                          .Add("vertices", std::uint64_t{12})
                          .Add("seconds", 0.25)
                          .Add("epsilon", std::nan(""));
  EXPECT_EQ(fields.text(),
            " state=FAILED label=\"\" words=\"a \\\"b\\\"\\u000a\" tricky=\"a=b\" certified=false"
            " vertices=12 seconds=0.25 epsilon=NaN");
  EXPECT_EQ(fields.json(), R"(,"state":"FAILED","label":"","words":"a \"b\"\u000a","tricky":"a=b")"
                           R"(,"certified":false,"vertices":12,"seconds":0.25,"epsilon":null)");

  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kInfo, LogFormat::kText);
  Log(LogLevel::kInfo, {"meshes/ab", 7}, "mesh ended", LogFields().Add("vertices", 5));
  StartLogging(LogLevel::kWarning, LogFormat::kJson);
  Log(LogLevel::kWarning, {}, "it is", LogFields().Add("worker", "\x9b[2J"));
  const std::string text = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("[meshes/ab round 7] mesh ended vertices=5\n"), std::string::npos) << text;
  EXPECT_NE(text.find(R"("message":"it is","worker":")"), std::string::npos) << text;
}

TEST(Log, WordsThatTurnTheOrderOfWritingAreTakenOut) {
  for (const LogFormat format : {LogFormat::kText, LogFormat::kJson}) {
    ::testing::internal::CaptureStderr();
    StartLogging(LogLevel::kInfo, format);
    Log(LogLevel::kInfo, {"meshes/ab", 7}, "meshing a\u202eb\u2067c\u200fd\u2028e\u0085f\xff\xc3");
    const std::string text = ::testing::internal::GetCapturedStderr();
    EXPECT_NE(text.find("meshing a b c d e f  "), std::string::npos) << text;
  }
}

std::ptrdiff_t LinesWith(const std::string& log, const std::string& words) {
  std::ptrdiff_t lines = 0;
  for (std::size_t at = log.find(words); at != std::string::npos; at = log.find(words, at + 1)) {
    ++lines;
  }
  return lines;
}

TEST(Log, OneOwnersLinesAreRationedAndCounted) {
  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kInfo, LogFormat::kText);
  for (int i = 0; i < 10'000; ++i) Log(LogLevel::kInfo, {"meshes/ab", 7, "mallory"}, "noise");
  Log(LogLevel::kInfo, {"meshes/cd", 7, "alice"}, "worker joined");
  LogLeftOut();
  LogLeftOut();
  const std::string text = ::testing::internal::GetCapturedStderr();
  const std::ptrdiff_t noise = LinesWith(text, "noise");
  EXPECT_GE(noise, 100);
  EXPECT_LE(noise, 1000) << "ten a second, and this took no minute and a half";
  EXPECT_EQ(LinesWith(text, "[meshes/cd round 7] worker joined"), 1);
  EXPECT_EQ(LinesWith(text, "meshes of owner mallory: more lines were left out lines=" +
                                std::to_string(10'000 - noise)),
            1)
      << text.substr(text.size() - std::min<std::size_t>(text.size(), 500));
}

}  // namespace
}  // namespace stellate::server
