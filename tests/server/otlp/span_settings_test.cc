#include "server/otlp/span_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <string>

namespace stellate::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pair;

Environment Of(std::map<std::string, std::string> variables) {
  return [variables = std::move(variables)](const std::string& name) {
    const auto it = variables.find(name);
    return it == variables.end() ? std::nullopt : std::optional(it->second);
  };
}

SpanSettings Found(const std::string& traces_to, std::map<std::string, std::string> variables) {
  auto found = FindSpanSettings(traces_to, Of(std::move(variables)));
  EXPECT_TRUE(found) << found.error().message;
  EXPECT_TRUE(found && *found);
  return found && *found ? std::move(**found) : SpanSettings();
}

std::string Trouble(const std::string& traces_to, std::map<std::string, std::string> variables) {
  const auto found = FindSpanSettings(traces_to, Of(std::move(variables)));
  return found ? "none" : found.error().message;
}

constexpr char kEndpoint[] = "OTEL_EXPORTER_OTLP_ENDPOINT";

TEST(SpanSettings, NobodyAsksForSpansByDefault) {
  for (std::map<std::string, std::string> variables :
       {std::map<std::string, std::string>{},
        {{kEndpoint, ""}},
        {{"OTEL_SERVICE_NAME", "mesher"}, {"OTEL_EXPORTER_OTLP_HEADERS", "nonsense"}},
        {{kEndpoint, "http://a:1"}, {"OTEL_SDK_DISABLED", "TRUE"}},
        {{kEndpoint, "http://a:1"}, {"OTEL_TRACES_EXPORTER", "none"}}}) {
    const auto found = FindSpanSettings("", Of(std::move(variables)));
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_FALSE(*found);
  }
}

TEST(SpanSettings, GoWhereTheOptionSaysBeforeTheEnvironment) {
  EXPECT_EQ(Found("", {{kEndpoint, "http://a:1/"}}).url.target, "a:1");
  EXPECT_EQ(
      Found("", {{kEndpoint, "http://a:1"}, {"OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "http://b"}})
          .url.target,
      "b:4317");
  const SpanSettings told =
      Found("https://[::1]:5", {{kEndpoint, "http://a:1"},
                                {"OTEL_SDK_DISABLED", "true"},
                                {"OTEL_EXPORTER_OTLP_PROTOCOL", "http/json"}});
  EXPECT_EQ(told.url.target, "[::1]:5");
  EXPECT_TRUE(told.url.tls);
  EXPECT_TRUE(told.url.is_local);
  EXPECT_EQ(told.service, "stellated");
  EXPECT_EQ(told.timeout.count(), 10'000);
}

TEST(SpanSettings, OfAnotherUrlSayWhatItMustBe) {
  for (const std::string url :
       {"a:4317", "grpc://a:4317", "http://", "http://a:b", "http://a:0", "http://a:70000",
        "http://a:1/v1/traces", "http://a,b:1", "http://unix:/a", "http://dns:///a:1",
        "http://a@b:1", "http://a b:1", "http://[::1:1"}) {
    EXPECT_THAT(Trouble(url, {}), HasSubstr("--traces-to is \"" + url)) << url;
    EXPECT_THAT(Trouble("", {{kEndpoint, url}}),
                HasSubstr(std::string(kEndpoint) + " is \"" + url));
  }
}

TEST(SpanSettings, AnotherProtocolIsNotSpokenWhateverItsEndpoint) {
  EXPECT_THAT(
      Trouble("", {{kEndpoint, "http://a:4318"}, {"OTEL_EXPORTER_OTLP_PROTOCOL", "http/protobuf"}}),
      HasSubstr("OTEL_EXPORTER_OTLP_PROTOCOL is \"http/protobuf\""));
  EXPECT_EQ(
      Found("", {{kEndpoint, "http://a"}, {"OTEL_EXPORTER_OTLP_PROTOCOL", "grpc"}}).url.target,
      "a:4317");
}

TEST(SpanSettings, HeadersAreThoseOfTheEnvironment) {
  const SpanSettings some = Found(
      "http://a", {{"OTEL_EXPORTER_OTLP_HEADERS", "Authorization=Bearer%20x%2Cy, x-scope = 7,"}});
  EXPECT_THAT(some.headers, ElementsAre(Pair("authorization", "Bearer x,y"), Pair("x-scope", "7")));
  const SpanSettings own = Found("http://a", {{"OTEL_EXPORTER_OTLP_HEADERS", "a=1"},
                                              {"OTEL_EXPORTER_OTLP_TRACES_HEADERS", "b=2"}});
  EXPECT_THAT(own.headers, ElementsAre(Pair("b", "2")));
}

TEST(SpanSettings, HeadersThatGrpcCannotSendAreRefusedWithoutTheirValues) {
  for (const std::string headers : {"secret", "=secret", "a b=secret", "grpc-timeout=secret",
                                    "x-bin=secret", "a=secret%0A", "a=secret%C3%A4", ":a=secret"}) {
    const std::string trouble = Trouble("http://a", {{"OTEL_EXPORTER_OTLP_HEADERS", headers}});
    EXPECT_THAT(trouble, HasSubstr("OTEL_EXPORTER_OTLP_HEADERS must be")) << headers;
    EXPECT_THAT(trouble, Not(HasSubstr("secret")));
  }
}

TEST(SpanSettings, TheProcessHasTheNameAndTheAttributesOfTheEnvironment) {
  const SpanSettings both = Found(
      "http://a", {{"OTEL_RESOURCE_ATTRIBUTES", "service.name=a,deployment.environment=test%20bed"},
                   {"OTEL_SERVICE_NAME", "b"}});
  EXPECT_EQ(both.service, "b");
  EXPECT_THAT(both.resource, ElementsAre(Pair("deployment.environment", "test bed")));
  EXPECT_EQ(Found("http://a", {{"OTEL_RESOURCE_ATTRIBUTES", "service.name=a"}}).service, "a");
}

TEST(SpanSettings, TimesAreMilliseconds) {
  EXPECT_EQ(Found("http://a", {{"OTEL_EXPORTER_OTLP_TIMEOUT", "250"}}).timeout.count(), 250);
  for (const std::string time : {"0", "-1", "soon", "1s"}) {
    EXPECT_THAT(Trouble("http://a", {{"OTEL_EXPORTER_OTLP_TIMEOUT", time}}),
                HasSubstr("OTEL_EXPORTER_OTLP_TIMEOUT is"));
  }
}

TEST(SpanSettings, FilesOfTlsAreReadWhereThereIsTls) {
  const std::string path = ::testing::TempDir() + "otlp.pem";
  std::ofstream(path) << "-----BEGIN CERTIFICATE-----\n";
  const std::string nowhere = ::testing::TempDir() + "no-such-otlp.pem";
  EXPECT_THAT(Found("https://a", {{"OTEL_EXPORTER_OTLP_CERTIFICATE", path}}).authority,
              HasSubstr("BEGIN"));
  EXPECT_EQ(Found("http://a", {{"OTEL_EXPORTER_OTLP_CERTIFICATE", nowhere}}).authority, "");
  EXPECT_THAT(Trouble("https://a", {{"OTEL_EXPORTER_OTLP_CERTIFICATE", nowhere}}),
              HasSubstr("OTEL_EXPORTER_OTLP_CERTIFICATE is " + nowhere));
  EXPECT_THAT(Trouble("https://a", {{"OTEL_EXPORTER_OTLP_CLIENT_KEY", path}}),
              HasSubstr("go together"));
}

}  // namespace
}  // namespace stellate::server
