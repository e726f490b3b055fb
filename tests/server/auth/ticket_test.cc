#include "server/auth/ticket.h"

#include <gtest/gtest.h>

namespace stellate::server {
namespace {

const std::string kSecret(32, 's');
const Ticket kTicket{7, 1234, "ada\nlovelace", true, "ipv4:10.0.0.1:40000"};

TEST(Ticket, SaysWhatWasSigned) {
  const std::string words = Sign(kTicket, kSecret);
  EXPECT_TRUE(IsTicket(words));
  EXPECT_EQ(ReadTicket(words, kSecret), kTicket);
  const Ticket nameless{1, 0, "", false, ""};
  EXPECT_EQ(ReadTicket(Sign(nameless, kSecret), kSecret), nameless);
}

TEST(Ticket, IsWorthNothingWithAnotherSecretOrOtherWords) {
  const std::string words = Sign(kTicket, kSecret);
  EXPECT_FALSE(ReadTicket(words, std::string(32, 't')));
  EXPECT_FALSE(ReadTicket(words, ""));
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::string other = words;
    other[i] = other[i] == '0' ? '1' : '0';
    EXPECT_FALSE(ReadTicket(other, kSecret)) << i;
    EXPECT_FALSE(ReadTicket(words.substr(0, i), kSecret)) << i;
  }
  EXPECT_FALSE(IsTicket("Bearer " + words));
}

}  // namespace
}  // namespace stellate::server
