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

TEST(TokenTable, AnOwnerHasAWeight) {
  const auto table = TokenTable::Parse(
      std::string("alice ") + kAlice + " weight=4\n" + Line("alice", "second-0123456789") + "bob " +
      kBob + " administrator weight=1000\n" + "cleo third-0123456789abcd weight=2 administrator\n" +
      Line("dan", "fourth-0123456789abc"));
  ASSERT_TRUE(table) << table.error().message;
  EXPECT_EQ(table->WeightOf("alice"), 4u);
  EXPECT_EQ(table->WeightOf("bob"), 1000u);
  EXPECT_EQ(table->HolderOf(Digest(kBob)), (TokenHolder{"bob", true}));
  EXPECT_EQ(table->WeightOf("cleo"), 2u);
  EXPECT_EQ(table->WeightOf("dan"), 1u);
  EXPECT_EQ(table->WeightOf("nobody"), 1u);
}

TEST(TokenTable, RefusesWeightsThatAreNone) {
  for (const char* weight :
       {"0", "-1", "nan", "inf", "1001", "99999999999999999999", "1.5", "", "+1", "4x", "1e2"}) {
    const auto table =
        TokenTable::Parse(Line("bob", kBob) + "alice " + kAlice + " weight=" + weight);
    ASSERT_FALSE(table) << weight;
    EXPECT_EQ(table.error().message,
              "line 2 must have behind \"weight=\" a whole number from 1 to 1000");
  }
  const std::string first = std::string("alice ") + kAlice + " weight=4\n";
  EXPECT_FALSE(TokenTable::Parse(first + "alice second-0123456789 weight=5"));
  EXPECT_TRUE(TokenTable::Parse(first + "alice second-0123456789 weight=4"));
  EXPECT_FALSE(TokenTable::Parse(std::string("alice ") + kAlice + " weight=4 weight=4"));
  EXPECT_FALSE(TokenTable::Parse(std::string("alice ") + kAlice + " weight 4"));
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
  EXPECT_EQ((*file)->WeightOf("bob"), 1u);
  WriteFile(path, std::string("bob ") + kBob + " weight=7\n");
  (*file)->Reload();
  EXPECT_EQ((*file)->WeightOf("bob"), 7u);
  WriteFile(path, std::string("bob ") + kBob + " weight=0\n");
  (*file)->Reload();
  EXPECT_EQ((*file)->WeightOf("bob"), 7u);
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
