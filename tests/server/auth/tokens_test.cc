#include "server/auth/tokens.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/server/support/certificates.h"

namespace stellate::server::testing {
namespace {

constexpr char kAlice[] = "alice-0123456789abcdef";
constexpr char kBob[] = "bob-0123456789abcdef";

std::string Line(const std::string& owner, const std::string& token) {
  return owner + " " + token + "\n";
}

TEST(TokenTable, TellsOwnersApart) {
  const auto table = TokenTable::Parse("# tokens\n\n" + Line("alice", kAlice) + "  bob\t" + kBob +
                                       "  \r\nalice second-0123456789");
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->size(), 3u);
  EXPECT_EQ(table->HolderOf(Digest(kAlice)), TokenHolder{"alice"});
  EXPECT_EQ(table->HolderOf(Digest("second-0123456789")), TokenHolder{"alice"});
  EXPECT_EQ(table->HolderOf(Digest(kBob)), TokenHolder{"bob"});
  EXPECT_EQ(table->HolderOf(Digest("")), std::nullopt);
  EXPECT_EQ(table->HolderOf(Digest("alice-0123456789abcdeg")), std::nullopt);
  EXPECT_EQ(table->HolderOf(Digest("alice-0123456789abcde")), std::nullopt);
}

TEST(TokenTable, AThirdWordMakesAnAdministrator) {
  const auto table = TokenTable::Parse(std::string("alice ") + kAlice + " \tadministrator \r\n" +
                                       Line("alice", "second-0123456789") + Line("bob", kBob));
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->HolderOf(Digest(kAlice)), (TokenHolder{"alice", true}));
  EXPECT_EQ(table->HolderOf(Digest("second-0123456789")), TokenHolder{"alice"});
  EXPECT_EQ(table->HolderOf(Digest(kBob)), TokenHolder{"bob"});
  for (const char* word : {"Administrator", "admin", "administrator administrator"})
    EXPECT_FALSE(TokenTable::Parse(std::string("alice ") + kAlice + " " + word)) << word;
}

TEST(TokenTable, RefusesBadLinesAndNeverQuotesThem) {
  for (const std::string& line :
       {std::string("alice"), std::string("secret0123456789secret0123456789"),
        Line("alice", "secret"), Line("alice", "secret0123456789 secret0123456789"),
        Line("al=ice", "secret0123456789secret"), Line(std::string(65, 'a'), "secret0123456789"),
        Line("alice", "secret0123456789\x01"), Line("alice", std::string(513, 's')),
        Line("bob", "fine-secret0123456789") + Line("eve", "fine-secret0123456789")}) {
    const auto table = TokenTable::Parse(Line("first", kAlice) + line);
    ASSERT_FALSE(table) << line;
    EXPECT_EQ(table.error().message.find("secret"), std::string::npos) << table.error().message;
    EXPECT_TRUE(table.error().message.starts_with("line ")) << table.error().message;
  }
  EXPECT_FALSE(TokenTable::Parse(""));
  EXPECT_FALSE(TokenTable::Parse("# nobody\n"));
}

TEST(TokenFile, IsReadAgainWhenItChanges) {
  const ScratchDirectory directory;
  const std::string path = directory / "tokens";
  EXPECT_FALSE(TokenFile::Open(path)) << "there is none";
  WriteFile(path, Line("alice", kAlice));
  const auto file = TokenFile::Open(path);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ((*file)->HolderOf(Digest(kAlice)), TokenHolder{"alice"});
  WriteFile(path, Line("bob", kBob));
  (*file)->Reload();
  EXPECT_EQ((*file)->HolderOf(Digest(kAlice)), std::nullopt);
  EXPECT_EQ((*file)->HolderOf(Digest(kBob)), TokenHolder{"bob"});
}

TEST(TokenFile, ABadOrMissingFileLeavesTheTokensInForce) {
  const ScratchDirectory directory;
  const std::string path = directory / "tokens";
  WriteFile(path, Line("alice", kAlice));
  const auto file = TokenFile::Open(path);
  ASSERT_TRUE(file);
  WriteFile(path, "nonsense\n");
  (*file)->Reload();
  EXPECT_EQ((*file)->HolderOf(Digest(kAlice)), TokenHolder{"alice"});
  std::filesystem::remove(path);
  (*file)->Reload(/*force=*/true);
  EXPECT_EQ((*file)->HolderOf(Digest(kAlice)), TokenHolder{"alice"});
  WriteFile(path, Line("bob", kBob));
  (*file)->Reload();
  EXPECT_EQ((*file)->HolderOf(Digest(kAlice)), std::nullopt);
}

}  // namespace
}  // namespace stellate::server::testing
