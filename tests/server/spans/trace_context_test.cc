#include "server/spans/trace_context.h"

#include <gtest/gtest.h>

#include <string>

namespace stellate::server {
namespace {

constexpr char kTrace[] = "0af7651916cd43dd8448eb211c80319c";
constexpr char kSpan[] = "b7ad6b7169203331";

std::string Parent(const std::string& version = "00", const std::string& flags = "01") {
  return version + "-" + kTrace + "-" + kSpan + "-" + flags;
}

TEST(TraceContext, IsReadAsW3cWritesIt) {
  const auto context = ReadTraceContext({Parent(), "vendor=1,other=2"});
  ASSERT_TRUE(context);
  EXPECT_EQ(context->trace[0], 0x0a);
  EXPECT_EQ(context->trace[15], 0x9c);
  EXPECT_EQ(context->span[0], 0xb7);
  EXPECT_EQ(context->span[7], 0x31);
  EXPECT_TRUE(context->sampled);
  EXPECT_EQ(context->state, "vendor=1,other=2");
}

TEST(TraceContext, SaysWhetherTheTraceIsSampled) {
  EXPECT_FALSE(ReadTraceContext({Parent("00", "00"), ""})->sampled);
  EXPECT_FALSE(ReadTraceContext({Parent("00", "fe"), ""})->sampled);
  EXPECT_TRUE(ReadTraceContext({Parent("00", "03"), ""})->sampled);
}

TEST(TraceContext, OfALaterVersionMayBeLonger) {
  EXPECT_TRUE(ReadTraceContext({Parent("01"), ""}));
  EXPECT_TRUE(ReadTraceContext({Parent("01") + "-more", ""}));
  EXPECT_FALSE(ReadTraceContext({Parent("01") + "more", ""}));
  EXPECT_FALSE(ReadTraceContext({Parent("00") + "-more", ""}));
  EXPECT_FALSE(ReadTraceContext({Parent("ff"), ""}));
}

TEST(TraceContext, ThatIsNoneIsLeftOut) {
  std::string capitals = Parent();
  capitals[4] = 'A';
  std::string dash = Parent();
  dash[35] = '_';
  const std::string zeros(32, '0');
  for (const std::string& parent :
       {std::string(), std::string("00"), std::string(4096, '-'), std::string(55, '\0'), capitals,
        dash, Parent().substr(0, 54), "00-" + zeros + "-" + kSpan + "-01",
        "00-" + std::string(kTrace) + "-" + zeros.substr(16) + "-01"}) {
    EXPECT_FALSE(ReadTraceContext({parent, "vendor=1"})) << parent;
  }
}

TEST(TraceContext, TakesNoStateThatOthersCouldNotHandOn) {
  for (const std::string& state :
       {std::string(513, 'a'), std::string("a=\n"), std::string("a=\xff")}) {
    EXPECT_EQ(ReadTraceContext({Parent(), state})->state, "");
  }
  EXPECT_EQ(ReadTraceContext({Parent(), std::string(512, 'a')})->state.size(), 512u);
}

TEST(TraceContext, OfAMeshIsItsName) {
  const TraceId trace = TraceOfMesh("meshes/" + std::string(kTrace));
  EXPECT_EQ(trace, ReadTraceContext({Parent(), ""})->trace);
  for (const std::string& name : {std::string(), std::string("meshes/1"), std::string(kTrace),
                                  "meshes/" + std::string(32, '0')}) {
    const TraceId drawn = TraceOfMesh(name);
    EXPECT_NE(drawn, TraceId{}) << name;
    EXPECT_NE(drawn, TraceOfMesh(name)) << name;
  }
}

TEST(TraceContext, DrawsAnotherSpanEachTime) {
  EXPECT_NE(NewSpanId(), SpanId{});
  EXPECT_NE(NewSpanId(), NewSpanId());
}

}  // namespace
}  // namespace stellate::server
