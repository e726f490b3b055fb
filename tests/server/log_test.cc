#include "server/log.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

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
  EXPECT_NE(text.find("[meshes/ab round 7] a client's words   [2J [2J\xce\xb5\n"),
            std::string::npos)
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
  EXPECT_EQ(fields.json(),
            R"(,"state":"FAILED","label":"","words":"a \"b\"\u000a","tricky":"a=b")"
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

}  // namespace
}  // namespace stellate::server
