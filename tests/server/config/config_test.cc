#include "server/config/config.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/config/listen_address.h"

namespace stellate::server {
namespace {

TEST(ListenAddress, ReadsTcpAndUnix) {
  const struct {
    const char* text;
    const char* target;
    bool loopback;
  } cases[] = {
      {"127.0.0.1:7717", "127.0.0.1:7717", true},
      {"localhost:0", "localhost:0", true},
      {"[::1]:80", "[::1]:80", true},
      {"unix:/run/s.sock", "unix:/run/s.sock", true},
      {"unix:///run/s.sock", "unix:/run/s.sock", true},
      {"0.0.0.0:1", "0.0.0.0:1", false},
      {"[::]:1", "[::]:1", false},
      {"example.org:443", "example.org:443", false},
      {"127.example.org:443", "127.example.org:443", false},
      {"127.1.2.3:443", "127.1.2.3:443", true},
  };
  for (const auto& [text, target, loopback] : cases) {
    const auto address = ParseListenAddress(text);
    ASSERT_TRUE(address) << text;
    EXPECT_EQ(address->Target(), target);
    EXPECT_EQ(address->IsLoopback(), loopback) << text;
  }
}

TEST(ListenAddress, RefusesNonsense) {
  for (const std::string& text :
       {std::string(""), std::string("localhost"), std::string(":80"), std::string("host:"),
        std::string("host:port"), std::string("host:70000"), std::string("host:-1"),
        std::string("::1:80"), std::string("unix:"), "unix:/" + std::string(200, 'x')}) {
    EXPECT_FALSE(ParseListenAddress(text)) << text;
  }
}

TEST(Config, TheDefaultIsValid) { EXPECT_TRUE(Validate(Config{}).ok()); }

TEST(Config, PlainTextBeyondThisMachineMustBeAskedFor) {
  Config config;
  config.listen = "0.0.0.0:7717";
  const core::Status status = Validate(config);
  EXPECT_NE(status.message.find("--insecure-listen"), std::string::npos) << status.message;
  config.insecure_listen = true;
  EXPECT_TRUE(Validate(config).ok());
}

TEST(Config, TlsMakesAnAddressSafeAndTokensNeedItThere) {
  Config config;
  config.listen = "0.0.0.0:7717";
  config.insecure_listen = true;
  config.token_file = "tokens";
  const core::Status status = Validate(config);
  EXPECT_TRUE(status.message.starts_with("--token-file")) << status.message;
  config.insecure_listen = false;
  config.tls_certificate = "cert.pem";
  EXPECT_TRUE(Validate(config).message.starts_with("--tls-cert")) << "the key is missing";
  config.tls_key = "key.pem";
  EXPECT_TRUE(Validate(config).ok());
  config.listen = "127.0.0.1:7717";
  config.tls_certificate = config.tls_key = "";
  EXPECT_TRUE(Validate(config).ok()) << "tokens may stay on this machine in plain text";
  config.tls_client_ca = "ca.pem";
  EXPECT_TRUE(Validate(config).message.starts_with("--tls-client-ca"));
}

TEST(Config, RefusalsNameTheFlag) {
  const auto expect = [](const char* flag, auto set) {
    Config config;
    set(&config);
    const core::Status status = Validate(config);
    EXPECT_EQ(status.code, core::StatusCode::kInvalidArgument) << flag;
    EXPECT_TRUE(status.message.starts_with(flag)) << status.message;
  };
  expect("--max-meshes", [](Config* c) { c->max_meshes = 0; });
  expect("--max-vertices", [](Config* c) { c->max_vertices = std::uint64_t{1} << 33; });
  expect("--max-ambient-dimension", [](Config* c) { c->max_ambient_dimension = -1; });
  expect("--max-message-bytes", [](Config* c) { c->max_message_bytes = 1000; });
  expect("--worker-wait", [](Config* c) { c->worker_wait_seconds = 0; });
  expect("--answer-seconds",
         [](Config* c) { c->answer_seconds = std::numeric_limits<double>::quiet_NaN(); });
  expect("--drain-seconds", [](Config* c) { c->drain_seconds = -1; });
  expect("--metrics-listen", [](Config* c) { c->metrics_listen = "unix:/run/metrics"; });
  expect("--metrics-listen", [](Config* c) { c->metrics_listen = "9090"; });
  expect("--keepalive",
         [](Config* c) { c->keepalive_seconds = std::numeric_limits<double>::infinity(); });
  expect("--data-dir", [](Config* c) {
    c->data_dir = "/somewhere";
    c->database = "postgresql:///meshes";
  });
  expect("--database-patience", [](Config* c) { c->database_patience_seconds = -1; });
}

TEST(Config, MeshesThatAreRecordedMayWaitLong) {
  Config config;
  EXPECT_FALSE(IsDurable(config));
  const double brief = MaxWaitSeconds(config);
  config.database = "postgresql:///meshes";
  EXPECT_TRUE(IsDurable(config));
  EXPECT_EQ(MaxWaitSeconds(config), 30 * 86400.0);
  EXPECT_LT(brief, MaxWaitSeconds(config));
}

}  // namespace
}  // namespace stellate::server
