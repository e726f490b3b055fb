#include "server/net/tls.h"

#include <gtest/gtest.h>

#include "tests/server/support/certificates.h"

namespace stellate::server {
namespace {

using testing::ReadFile;
using testing::TestAuthority;
using testing::WriteFile;

// The server's files, and what gRPC is given of them.
class TlsFilesTest : public ::testing::Test {
 protected:
  TlsFilesTest() {
    const std::string server = authority_.Issue("server");
    config_.tls_certificate = server + ".pem";
    config_.tls_key = server + ".key";
    config_.tls_client_ca = clients_.certificate();
    auto files = TlsFiles::Open(config_);
    EXPECT_TRUE(files) << files.error().message;
    files_ = std::move(*files);
  }

  std::array<std::string, 3> InForce() const {
    return {ReadFile(files_->PathOf(TlsFiles::kCertificate)),
            ReadFile(files_->PathOf(TlsFiles::kKey)),
            ReadFile(files_->PathOf(TlsFiles::kClientCa))};
  }
  std::array<std::string, 3> OnDisk() const {
    return {ReadFile(config_.tls_certificate), ReadFile(config_.tls_key),
            ReadFile(config_.tls_client_ca)};
  }

  const TestAuthority authority_, clients_{"clients"}, next_{"next"};
  Config config_;
  std::unique_ptr<TlsFiles> files_;
};

TEST_F(TlsFilesTest, WhatIsOnTheDiskIsInForce) {
  EXPECT_EQ(InForce(), OnDisk());
  const std::string renewed = next_.Issue("server");
  WriteFile(config_.tls_key, ReadFile(renewed + ".key"));
  WriteFile(config_.tls_certificate, ReadFile(renewed + ".pem"));
  WriteFile(config_.tls_client_ca,
            ReadFile(clients_.certificate()) + ReadFile(next_.certificate()));
  files_->Reload();
  EXPECT_EQ(InForce(), OnDisk());
}

TEST_F(TlsFilesTest, FilesThatCannotBeUsedChangeNothing) {
  const auto before = InForce();
  const std::string good_ca = before[TlsFiles::kClientCa];
  const std::string other = ReadFile(next_.certificate());
  for (const std::string& garbage :
       {std::string("garbage"), std::string(), good_ca.substr(0, good_ca.size() / 2),
        good_ca + other.substr(0, other.size() / 2),
        good_ca + std::string(other).replace(100, 4, "!!!!")}) {
    WriteFile(config_.tls_client_ca, garbage);
    files_->Reload();
    EXPECT_EQ(InForce(), before) << garbage;
  }
  std::filesystem::remove(config_.tls_client_ca);
  files_->Reload();
  EXPECT_EQ(InForce(), before);

  WriteFile(config_.tls_client_ca, good_ca);
  WriteFile(config_.tls_key, ReadFile(next_.Issue("other") + ".key"));
  files_->Reload();
  EXPECT_EQ(InForce(), before) << "it is not the key of the certificate";

  WriteFile(config_.tls_key, before[TlsFiles::kKey]);
  WriteFile(config_.tls_client_ca, other);
  files_->Reload();
  EXPECT_EQ(InForce(), OnDisk()) << "and then all is well again";
}

TEST_F(TlsFilesTest, AnUnchangedFileIsReadAgainWhenToldTo) {
  WriteFile(config_.tls_client_ca, "garbage");
  files_->Reload();
  const auto before = InForce();
  files_->Reload(/*force=*/true);
  EXPECT_EQ(InForce(), before);
}

}  // namespace
}  // namespace stellate::server
