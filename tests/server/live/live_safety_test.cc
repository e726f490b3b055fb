// Strangers, wrong certificates and other people's meshes, against a live server.

#include <grpcpp/generic/generic_stub.h>

#include <sstream>
#include <vector>

#include "server/net/health_check.h"
#include "server/net/tls.h"
#include "tests/server/support/certificates.h"
#include "tests/server/support/live_server.h"
#include "tests/server/support/token_client.h"

namespace stellate::server::testing {
namespace {

using namespace std::chrono_literals;
using grpc::StatusCode;

constexpr char kAlice[] = "alice-0123456789abcdef";
constexpr char kBob[] = "bob-0123456789abcdef";
constexpr char kUnknownMesh[] = "meshes/00000000000000000000000000000000";

std::string Replaced(std::string text, const std::string& what, const std::string& by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what)) {
    text.replace(at, what.size(), by);
  }
  return text;
}

class LiveSafetyTest : public LiveServer {
 protected:
  void WriteTokens(const std::string& text) { WriteFile(directory_ / "tokens", text); }

  void StartWithTokens(Config config = {}) {
    WriteTokens(std::string("alice ") + kAlice + "\nbob " + kBob + "\n");
    config.token_file = directory_ / "tokens";
    Start(config);
  }

  // With TLS, on a port of the loopback.
  void StartWithTls(Config config = {}) {
    const std::string files = authority_.Issue("server");
    config.tls_certificate = files + ".pem";
    config.tls_key = files + ".key";
    config_ = config;
    StartTcp(config);
  }

  static std::shared_ptr<grpc::ChannelCredentials> Tls(const TestAuthority& trusted,
                                                       const std::string& own = "") {
    grpc::SslCredentialsOptions options;
    options.pem_root_certs = ReadFile(trusted.certificate());
    if (!own.empty()) {
      options.pem_cert_chain = ReadFile(own + ".pem");
      options.pem_private_key = ReadFile(own + ".key");
    }
    return grpc::SslCredentials(options);
  }

  TokenClient Plain(const std::string& token) {
    return {server_->address(), grpc::InsecureChannelCredentials(), token};
  }
  TokenClient Secure(std::shared_ptr<grpc::ChannelCredentials> credentials,
                     const std::string& token = "") {
    return {server_->address(), std::move(credentials), token};
  }

  static std::string CreateBy(TokenClient* client) {
    v1::Mesh mesh;
    const grpc::Status status = client->Create(&mesh, SpecOfSphere());
    EXPECT_TRUE(status.ok()) << status.error_message();
    return mesh.name();
  }

  // `stranger` learns nothing of `owner`'s mesh, and does it no harm.
  static void ExpectHidden(TokenClient* owner, TokenClient* stranger) {
    const std::string name = CreateBy(owner);
    const auto foreign = stranger->AskAllOf(name);
    const auto unknown = stranger->AskAllOf(kUnknownMesh);
    for (std::size_t i = 0; i < foreign.size(); ++i) {
      const auto& [rpc, status] = foreign[i];
      EXPECT_EQ(status.error_code(), StatusCode::NOT_FOUND) << rpc;
      EXPECT_EQ(ReasonIn(status), "MESH_NOT_FOUND") << rpc;
      EXPECT_EQ(Replaced(status.error_message(), name, kUnknownMesh),
                unknown[i].second.error_message())
          << rpc;
      EXPECT_EQ(Replaced(status.error_details(), name, kUnknownMesh),
                unknown[i].second.error_details())
          << rpc;
    }
    v1::ListMeshesResponse list;
    ASSERT_TRUE(stranger->List(&list).ok());
    EXPECT_EQ(list.meshes_size(), 0);
    EXPECT_EQ(list.next_page_token(), "");
    list.Clear();
    ASSERT_TRUE(owner->List(&list).ok());
    ASSERT_EQ(list.meshes_size(), 1);
    EXPECT_EQ(list.meshes(0).name(), name);
    EXPECT_EQ(list.meshes(0).state(), v1::MESH_STATE_WAITING);
  }

  const ScratchDirectory directory_;
  const TestAuthority authority_;
  Config config_;
};

TEST_F(LiveSafetyTest, AnIdOfAnotherOwnersMeshIsTaken) {
  StartWithTokens();
  TokenClient alice = Plain(kAlice), bob = Plain(kBob);
  const std::string name = CreateBy(&alice);
  v1::Mesh mesh;
  const grpc::Status status = bob.Create(&mesh, SpecOfSphere(), name.substr(7));
  EXPECT_EQ(status.error_code(), StatusCode::INVALID_ARGUMENT) << status.error_message();
  EXPECT_EQ(FieldIn(status), "mesh_id");
  EXPECT_EQ(mesh.name(), "");
}

TEST_F(LiveSafetyTest, EveryCallNeedsAKnownToken) {
  StartWithTokens();
  TokenClient alice = Plain(kAlice);
  const std::string name = CreateBy(&alice);
  for (const std::string& token :
       {std::string(), std::string("alice"), std::string(kAlice) + "0", std::string(4000, 'x')}) {
    TokenClient stranger = Plain(token);
    v1::Mesh mesh;
    v1::ListMeshesResponse list;
    auto statuses = stranger.AskAllOf(name);
    statuses.emplace_back("CreateMesh", stranger.Create(&mesh, SpecOfSphere()));
    statuses.emplace_back("ListMeshes", stranger.List(&list));
    statuses.emplace_back("GetServerInfo", stranger.Info());
    for (const auto& [rpc, status] : statuses) {
      EXPECT_EQ(status.error_code(), StatusCode::UNAUTHENTICATED) << rpc;
      EXPECT_EQ(ReasonIn(status), "UNAUTHENTICATED") << rpc;
      if (!token.empty()) {
        EXPECT_EQ(status.error_message().find(token), std::string::npos) << rpc;
      }
    }
    EXPECT_EQ(list.meshes_size(), 0);
  }
  v1::Mesh mesh;
  ASSERT_TRUE(alice.Get(name, &mesh).ok());
  EXPECT_EQ(mesh.state(), v1::MESH_STATE_WAITING);
  EXPECT_EQ(CheckHealth(server_->address(), 60s), "") << "probes need no token";
}

TEST_F(LiveSafetyTest, OwnersCannotTellEachOthersMeshesFromNone) {
  StartWithTokens();
  TokenClient alice = Plain(kAlice), bob = Plain(kBob);
  ExpectHidden(&alice, &bob);
}

TEST_F(LiveSafetyTest, PagesHoldTheOwnersMeshesAlone) {
  StartWithTokens();
  TokenClient alice = Plain(kAlice), bob = Plain(kBob);
  const std::string first = CreateBy(&alice);
  CreateBy(&bob);
  const std::string second = CreateBy(&alice);
  CreateBy(&bob);
  v1::ListMeshesResponse page;
  ASSERT_TRUE(alice.List(&page).ok());
  ASSERT_EQ(page.meshes_size(), 1);
  EXPECT_EQ(page.meshes(0).name(), first);
  const std::string token = page.next_page_token();
  page.Clear();
  ASSERT_TRUE(alice.List(&page, token).ok());
  ASSERT_EQ(page.meshes_size(), 1);
  EXPECT_EQ(page.meshes(0).name(), second);
  EXPECT_EQ(page.next_page_token(), "");
}

TEST_F(LiveSafetyTest, TokensComeAndGoWithoutARestart) {
  StartWithTokens();
  TokenClient alice = Plain(kAlice), bob = Plain(kBob), carol = Plain("carol-0123456789abcdef");
  const std::string name = CreateBy(&alice);
  EXPECT_EQ(carol.Info().error_code(), StatusCode::UNAUTHENTICATED);
  grpc::Status watched;
  std::thread watching([&] { watched = alice.Watch(name); });
  v1::Mesh mesh;
  while (mesh.watchers() == 0) ASSERT_TRUE(alice.Get(name, &mesh).ok());
  WriteTokens(std::string("carol carol-0123456789abcdef\nbob ") + kBob + "\n");
  server_->ReloadFiles();
  EXPECT_TRUE(carol.Info().ok());
  EXPECT_TRUE(bob.Info().ok());
  EXPECT_EQ(alice.Info().error_code(), StatusCode::UNAUTHENTICATED);
  watching.join();  // its stream ends, though the mesh does not
  EXPECT_EQ(watched.error_code(), StatusCode::UNAUTHENTICATED);
  EXPECT_EQ(ReasonIn(watched), "UNAUTHENTICATED");
  // Without being told, the server looks by itself.
  WriteTokens(std::string("alice ") + kAlice + "\n");
  while (!alice.Info().ok()) std::this_thread::sleep_for(50ms);
  EXPECT_TRUE(alice.Get(name, &mesh).ok()) << "a mesh outlives its owner's absence";
}

TEST_F(LiveSafetyTest, AWithdrawnTokenEndsAStreamThatHasSentNoRequest) {
  StartWithTokens();
  const auto channel = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
  grpc::GenericStub stub(channel);
  for (const char* rpc : {"WatchMesh", "DownloadMesh", "ServeOracle", "Examine"}) {
    WriteTokens(std::string("alice ") + kAlice + "\nbob " + kBob + "\n");
    server_->ReloadFiles();
    grpc::ClientContext context;
    context.AddMetadata("authorization", std::string("Bearer ") + kAlice);
    grpc::CompletionQueue queue;
    const auto call =
        stub.PrepareCall(&context, std::string("/stellate.v1.Stellate/") + rpc, &queue);
    const auto await = [&queue] {
      void* tag = nullptr;
      bool ok = false;
      EXPECT_TRUE(queue.Next(&tag, &ok));
    };
    call->StartCall(nullptr);
    await();
    grpc::ClientContext next;
    next.AddMetadata("authorization", std::string("Bearer ") + kAlice);
    v1::ServerInfo info;
    EXPECT_TRUE(v1::Stellate::NewStub(channel)->GetServerInfo(&next, {}, &info).ok())
        << "on the same connection, so that the server has the stream by now";
    WriteTokens(std::string("bob ") + kBob + "\n");
    server_->ReloadFiles();
    grpc::Status status;
    call->Finish(&status, nullptr);
    await();
    EXPECT_EQ(status.error_code(), StatusCode::UNAUTHENTICATED) << rpc << status.error_message();
  }
}

TEST_F(LiveSafetyTest, AnAdministratorSeesAndEndsEverybodysAndAnswersForNobody) {
  StartWithTokens();
  const std::string token = "root-0123456789abcdef";
  WriteTokens(std::string("alice ") + kAlice + "\nbob " + kBob + "\nroot " + token +
              " administrator\n");
  server_->ReloadFiles();
  TokenClient alice = Plain(kAlice), bob = Plain(kBob), root = Plain(token);
  const std::string first = CreateBy(&alice), second = CreateBy(&bob);

  v1::ListMeshesResponse page;
  ASSERT_TRUE(root.List(&page).ok());
  ASSERT_EQ(page.meshes_size(), 1);
  EXPECT_EQ(page.meshes(0).name(), first);
  EXPECT_EQ(page.meshes(0).owner(), "alice");
  const std::string next = page.next_page_token();
  page.Clear();
  ASSERT_TRUE(root.List(&page, next).ok());
  ASSERT_EQ(page.meshes_size(), 1);
  EXPECT_EQ(page.meshes(0).name(), second);
  EXPECT_EQ(page.meshes(0).owner(), "bob");

  v1::Mesh mesh;
  ASSERT_TRUE(root.Get(first, &mesh).ok());
  EXPECT_EQ(mesh.owner(), "alice");
  ASSERT_TRUE(alice.Get(first, &mesh).ok());
  EXPECT_EQ(mesh.owner(), "") << "which is nothing to owners";
  EXPECT_EQ(root.Serve(first).error_code(), StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(bob.Cancel(first).error_code(), StatusCode::NOT_FOUND);
  EXPECT_TRUE(root.Cancel(first).ok());
  v1::Mesh final;
  EXPECT_TRUE(root.Watch(first, &final).ok());
  EXPECT_EQ(final.state(), v1::MESH_STATE_CANCELLED);
  EXPECT_TRUE(root.Delete(second).ok());
  EXPECT_EQ(bob.Get(second, &mesh).error_code(), StatusCode::NOT_FOUND);

  // Once the word is taken away he is an owner as others are.
  WriteTokens(std::string("alice ") + kAlice + "\nroot " + token + "\n");
  server_->ReloadFiles();
  EXPECT_EQ(root.Get(first, &mesh).error_code(), StatusCode::NOT_FOUND);
}

TEST_F(LiveSafetyTest, TheLogSaysWhoDidWhatWithWhoseMesh) {
  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kInfo, LogFormat::kText);
  StartWithTokens();
  const std::string token = "root-0123456789abcdef";
  WriteTokens(std::string("alice ") + kAlice + "\nroot " + token + " administrator\n");
  server_->ReloadFiles();
  TokenClient alice = Plain(kAlice), root = Plain(token);
  const std::string served = CreateBy(&alice), ended = CreateBy(&alice);
  std::thread serving([&] { alice.Serve(served); });
  EXPECT_TRUE(alice.Watch(served).ok());
  serving.join();
  EXPECT_TRUE(alice.Download(served).ok());
  EXPECT_TRUE(root.Cancel(ended).ok());
  EXPECT_TRUE(root.Delete(ended).ok());
  server_->Stop(0s);
  StartLogging(LogLevel::kWarning, LogFormat::kText);
  const std::string log = ::testing::internal::GetCapturedStderr();
  const auto expect = [&log](const std::string& mesh, const std::string& words) {
    std::istringstream lines(log);
    std::string line;
    const auto fits = [&] {
      return line.find(mesh) != std::string::npos &&
             line.find("audit action=" + words) != std::string::npos;
    };
    while (std::getline(lines, line) && !fits()) {
    }
    EXPECT_TRUE(fits()) << words << " in " << log;
    EXPECT_NE(line.find(" address="), std::string::npos) << line;
  };
  for (const char* action : {"create", "serve", "watch", "download"})
    expect(served, std::string(action) + " by=alice administrator=false owner=alice");
  for (const char* action : {"cancel", "delete"})
    expect(ended, std::string(action) + " by=root administrator=true owner=alice");
}

TEST_F(LiveSafetyTest, TokensAreNeverLogged) {
  ::testing::internal::CaptureStderr();
  StartLogging(LogLevel::kTrace, LogFormat::kText);
  StartWithTokens();
  TokenClient alice = Plain(kAlice), stranger = Plain("stranger-0123456789abcdef");
  const std::string name = CreateBy(&alice);
  stranger.AskAllOf(name);
  std::thread serving([&] { alice.Serve(name); });
  EXPECT_TRUE(alice.Watch(name).ok());
  serving.join();
  WriteTokens("alice alice-broken\n");
  server_->ReloadFiles();
  server_->Stop(0s);
  StartLogging(LogLevel::kWarning, LogFormat::kText);
  const std::string log = ::testing::internal::GetCapturedStderr();
  EXPECT_NE(log.find(name), std::string::npos) << "the log was captured";
  for (const std::string secret : {"0123456789abcdef", "alice-broken"}) {
    EXPECT_EQ(log.find(secret), std::string::npos) << log;
  }
}

TEST_F(LiveSafetyTest, TlsServesThoseWhoTrustItAlone) {
  StartWithTls();
  EXPECT_TRUE(Secure(Tls(authority_)).Info().ok());
  const TestAuthority other("other");
  EXPECT_EQ(Secure(Tls(other)).Info().error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(Plain("").Info().error_code(), StatusCode::UNAVAILABLE) << "plain text is no way in";
}

TEST_F(LiveSafetyTest, MutualTlsAsksForACertificateAndNamesTheOwnerByIt) {
  Config config;
  config.tls_client_ca = authority_.certificate();
  StartWithTls(config);
  const TestAuthority other("other");
  EXPECT_EQ(Secure(Tls(authority_)).Info().error_code(), StatusCode::UNAVAILABLE);
  EXPECT_EQ(Secure(Tls(authority_, other.Issue("alice"))).Info().error_code(),
            StatusCode::UNAVAILABLE);
  TokenClient alice = Secure(Tls(authority_, authority_.Issue("alice")));
  TokenClient bob = Secure(Tls(authority_, authority_.Issue("bob")));
  ExpectHidden(&alice, &bob);
}

TEST_F(LiveSafetyTest, AMeshIsMadeOverMutualTlsWithATokenWhichNamesTheOwner) {
  WriteTokens(std::string("alice ") + kAlice + "\nbob " + kBob + "\n");
  Config config;
  config.token_file = directory_ / "tokens";
  config.tls_client_ca = authority_.certificate();
  StartWithTls(config);
  const auto credentials = Tls(authority_, authority_.Issue("somebody"));
  TokenClient alice = Secure(credentials, kAlice), bob = Secure(credentials, kBob);
  EXPECT_EQ(Secure(credentials).Info().error_code(), StatusCode::UNAUTHENTICATED);
  ExpectHidden(&alice, &bob);
  const std::string name = CreateBy(&alice);
  grpc::Status served;
  std::thread serving([&] { served = alice.Serve(name); });
  v1::Mesh final;
  EXPECT_TRUE(alice.Watch(name, &final).ok());
  serving.join();
  EXPECT_TRUE(served.ok()) << served.error_message();
  EXPECT_EQ(final.state(), v1::MESH_STATE_SUCCEEDED);
}

TEST_F(LiveSafetyTest, ARenewedCertificateNeedsNoRestart) {
  StartWithTls();
  const TestAuthority next("next");
  EXPECT_EQ(Secure(Tls(next)).Info().error_code(), StatusCode::UNAVAILABLE);
  const std::string files = next.Issue("server");
  WriteFile(config_.tls_key, ReadFile(files + ".key"));
  WriteFile(config_.tls_certificate, ReadFile(files + ".pem"));
  while (!Secure(Tls(next)).Info().ok()) std::this_thread::sleep_for(200ms);
  EXPECT_EQ(Secure(Tls(authority_)).Info().error_code(), StatusCode::UNAVAILABLE);
}

// As a garbage token file: what was read before stays in force.
TEST_F(LiveSafetyTest, AGarbageClientAuthorityShutsNobodyOut) {
  const TestAuthority clients("clients"), next("next");
  Config config;
  config.tls_client_ca = clients.certificate();
  StartWithTls(config);
  const auto mine = Tls(authority_, clients.Issue("me"));
  const auto other = Tls(authority_, next.Issue("you"));
  const std::string before = ReadFile(clients.certificate());
  EXPECT_TRUE(Secure(mine).Info().ok());
  WriteFile(config_.tls_client_ca, "garbage");
  server_->ReloadFiles();
  // gRPC looks every two seconds, without a word: longer than it takes to notice.
  for (int i = 0; i < 15; ++i) {
    EXPECT_TRUE(Secure(mine).Info().ok());
    std::this_thread::sleep_for(200ms);
  }
  EXPECT_EQ(Secure(other).Info().error_code(), StatusCode::UNAVAILABLE);
  WriteFile(config_.tls_client_ca, before + ReadFile(next.certificate()));
  server_->ReloadFiles();
  while (!Secure(other).Info().ok()) std::this_thread::sleep_for(200ms);
  EXPECT_TRUE(Secure(mine).Info().ok());
}

TEST_F(LiveSafetyTest, TheHealthCheckGoesThroughMutualTls) {
  Config config;
  config.tls_client_ca = authority_.certificate();
  StartWithTls(config);
  EXPECT_EQ(CheckHealth(server_->address(), 60s, SelfCheckCredentials(config_)), "");
  EXPECT_NE(CheckHealth(server_->address(), 60s), "");
}

TEST_F(LiveSafetyTest, FilesThatCannotBeUsedAreRefusedAtTheStart) {
  const std::string a = authority_.Issue("a"), b = authority_.Issue("b");
  WriteTokens("nonsense\n");
  const auto expect = [&](const char* flag, const std::string& certificate, const std::string& key,
                          const std::string& client_ca, const std::string& tokens) {
    Config config;
    config.listen = "127.0.0.1:0";
    config.tls_certificate = certificate;
    config.tls_key = key;
    config.tls_client_ca = client_ca;
    config.token_file = tokens;
    const auto server = Server::Start(config);
    ASSERT_FALSE(server) << flag;
    EXPECT_EQ(server.error().code, core::StatusCode::kInvalidArgument);
    EXPECT_TRUE(server.error().message.starts_with(flag)) << server.error().message;
  };
  expect("--tls-cert", directory_ / "none", a + ".key", "", "");
  expect("--tls-cert", a + ".key", a + ".key", "", "");
  expect("--tls-key", a + ".pem", a + ".pem", "", "");
  expect("--tls-key", a + ".pem", b + ".key", "", "");
  expect("--tls-client-ca", a + ".pem", a + ".key", a + ".key", "");
  expect("--token-file", "", "", "", directory_ / "none");
  expect("--token-file", "", "", "", directory_ / "tokens");
}

}  // namespace
}  // namespace stellate::server::testing
