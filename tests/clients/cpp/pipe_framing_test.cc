// What goes through an oracle command's pipe: every right form, in any pieces, and every wrong one
// refused with words that name the place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "pipe/framing.h"
#include "pipe/numbers.h"
#include "stellate/command_oracle.h"

namespace stellate::pipe {
namespace {

using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <typename Act>
std::string ErrorOf(const Act& act) {
  try {
    act();
  } catch (const Garbled& e) {
    return e.what();
  }
  return "";
}

// Three points of R^3 and a surface; tangents wanted.
class Framing : public ::testing::TestWithParam<bool> {
 protected:
  Framing() : points(3, 3), bases(6, 3), radii(3) {
    points << 1, 2, 3, -0.5, 1e-20, 6, 0, 1.0 / 3, 1e300;
    bases.setConstant(0.25);
    radii << 1, 2, 4;
  }
  Question Asked(bool tangents, bool sizes) const {
    return {2, points, nullptr, nullptr, tangents, sizes};
  }

  Eigen::MatrixXd points, bases;
  Eigen::VectorXd radii;
};

std::string Raw(const auto&... values) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
  return bytes;
}

std::string Raw(const Eigen::MatrixXd& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()),
          sizeof(double) * static_cast<size_t>(numbers.size())};
}

Answer Read(const Question& question, bool text, std::string bytes) {
  const auto reader = AnswerReader::Make(question, text);
  EXPECT_TRUE(reader->Take(&bytes));
  EXPECT_EQ(bytes, "");
  return reader->Finish();
}

// A right answer of three rows, the second not found.
std::string AnswerBytes(const Eigen::MatrixXd& points, bool text, bool tangents, bool sizes) {
  const std::uint32_t flags = (tangents ? 1u : 0u) | (sizes ? 2u : 0u) | 4u;
  std::string bytes = text ? "" : Raw(std::uint32_t{3}, flags) + Raw(points);
  if (!text && tangents) bytes += Raw(Eigen::MatrixXd(Eigen::MatrixXd::Constant(6, 3, 0.5)));
  if (!text && sizes) bytes += Raw(Eigen::MatrixXd(Eigen::MatrixXd::Constant(1, 3, 0.125)));
  if (!text) return bytes + std::string("\1\0\1", 3);
  for (int j = 0; j < 3; ++j) {
    std::string row;
    for (int i = 0; i < 3; ++i) AppendNumber(points(i, j), &(row += ' '));
    if (tangents) row += " 0.5 .5 +0.5 5e-1 0.50 0.5";
    if (sizes) row += "\t0.125\r";
    bytes += j == 1 ? "-\n" : row + "\n";
  }
  return bytes;
}

TEST_P(Framing, AnswersMayComeInAnyPieces) {
  for (const bool tangents : {false, true}) {
    for (const bool sizes : {false, true}) {
      const std::string whole = AnswerBytes(points, GetParam(), tangents, sizes);
      for (size_t step = 1; step <= whole.size(); ++step) {
        const auto reader = AnswerReader::Make(Asked(tangents, sizes), GetParam());
        std::string unread;
        for (size_t at = 0; at < whole.size(); at += step) {
          unread += whole.substr(at, step);
          ASSERT_EQ(reader->Take(&unread), at + step >= whole.size()) << "at " << at;
        }
        const Answer answer = reader->Finish();
        EXPECT_EQ(answer.points.col(0), points.col(0));
        EXPECT_EQ(answer.points.col(2), points.col(2));
        EXPECT_EQ(answer.found, (std::vector<std::uint8_t>{1, 0, 1}));
        EXPECT_EQ(answer.tangents.cols(), tangents ? 3 : 0);
        EXPECT_EQ(answer.sizes.size(), sizes ? 3 : 0);
        EXPECT_TRUE(!tangents || (answer.tangents.col(2).array() == 0.5).all());
        EXPECT_TRUE(!sizes || answer.sizes[2] == 0.125);
      }
    }
  }
}

TEST_P(Framing, WhatWasNotAskedForIsLeftOut) {
  const Answer answer =
      Read(Asked(false, false), GetParam(), AnswerBytes(points, GetParam(), true, true));
  EXPECT_EQ(answer.tangents.size(), 0);
  EXPECT_EQ(answer.sizes.size(), 0);
}

TEST_P(Framing, WhatWasPromisedHasToBeThere) {
  const std::string bytes = AnswerBytes(points, GetParam(), false, false);
  EXPECT_THAT(ErrorOf([&] { Read(Asked(true, false), GetParam(), bytes); }),
              HasSubstr("no tangents"));
  EXPECT_THAT(ErrorOf([&] { Read(Asked(false, true), GetParam(), bytes); }), HasSubstr("no sizes"));
}

TEST_P(Framing, OnlyFoundRowsHaveToBeFinite) {
  Eigen::MatrixXd answered = points;
  answered(2, 1) = kNaN;  // not found
  Read(Asked(false, false), GetParam(), AnswerBytes(answered, GetParam(), false, false));
  answered(1, 2) = kNaN;
  const std::string error = ErrorOf([&] {
    Read(Asked(false, false), GetParam(), AnswerBytes(answered, GetParam(), false, false));
  });
  EXPECT_THAT(error, HasSubstr("row 3 of 3"));
  EXPECT_THAT(error, HasSubstr("for the query (3, 6,"));
}

TEST_P(Framing, NothingFoundIsAnAnswer) {
  const std::string bytes = GetParam() ? "-\n-\n-\n"
                                       : Raw(std::uint32_t{3}, std::uint32_t{7}) +
                                             std::string(8 * (9 + 18 + 3) + 3, '\0');
  const Answer answer = Read(Asked(true, true), GetParam(), bytes);
  EXPECT_EQ(answer.found, (std::vector<std::uint8_t>{0, 0, 0}));
  EXPECT_EQ(answer.tangents.cols(), 3);
  EXPECT_EQ(answer.sizes.size(), 3);
}

TEST_P(Framing, CommandsReportErrorsInTheirOwnWords) {
  const std::string words = "no licence";
  std::string bytes =
      GetParam() ? "error " + words + "\n" : Raw(std::uint32_t{10}, std::uint32_t{8}) + words;
  const auto reader = AnswerReader::Make(Asked(false, false), GetParam());
  try {
    reader->Take(&bytes);
    FAIL();
  } catch (const CommandError& e) {
    EXPECT_THAT(e.what(), HasSubstr(words));
  }
}

INSTANTIATE_TEST_SUITE_P(Both, Framing, ::testing::Bool(),
                         [](const auto& tried) { return tried.param ? "Text" : "Binary"; });

TEST_F(Framing, BinaryQuestionsAreTheirNumbers) {
  EXPECT_EQ(
      ToBytes(Asked(true, false), false),
      Raw(std::uint32_t{1}, std::uint32_t{3}, std::uint32_t{1}, std::uint32_t{0}) + Raw(points));
  EXPECT_EQ(ToBytes({2, points, &bases, &radii, false, true}, false),
            Raw(std::uint32_t{2}, std::uint32_t{3}, std::uint32_t{2}, std::uint32_t{0}) +
                Raw(points) + Raw(bases) + Raw(Eigen::MatrixXd(radii)));
}

TEST_F(Framing, TextQuestionsAreExactAndHaveNoExponents) {
  points.col(2) << 0.1, -0.0, 5e-324;
  const std::string bytes = ToBytes(Asked(true, false), true);
  EXPECT_EQ(bytes.rfind("closest 3 1 0\n1 -0.5 0\n2 0.00000000000000000001 0.3333333333333333", 0),
            0u)
      << bytes;
  EXPECT_EQ(bytes.find('e', 7), std::string::npos);
  const size_t last = bytes.rfind(' ');
  double number = 1;
  ASSERT_TRUE(ParseNumber(bytes.substr(last + 1, bytes.size() - last - 2), &number));
  EXPECT_EQ(number, 5e-324);
  const std::string flat = ToBytes({2, points, &bases, &radii, false, true}, true);
  EXPECT_EQ(flat.rfind("flat 3 0 1\n1 -0.5 0 0.25 0.25 0.25 0.25 0.25 0.25 1\n", 0), 0u) << flat;
}

TEST_F(Framing, WrongBinaryAnswersAreNamed) {
  const auto error = [this](std::string bytes) {
    return ErrorOf([&] { Read(Asked(false, false), false, std::move(bytes)); });
  };
  EXPECT_THAT(error(Raw(std::uint32_t{4}, std::uint32_t{0})), HasSubstr("4 rows and was asked 3"));
  EXPECT_THAT(error("Hello, I am a banner"), HasSubstr("'Hello, I am a banner'"));
  EXPECT_THAT(error(Raw(std::uint32_t{1u << 31}, std::uint32_t{8})), HasSubstr("8 bytes"));
  EXPECT_THAT(error(Raw(std::uint32_t{3}, std::uint32_t{4}) + Raw(points) + "\1\2\1"),
              HasSubstr("row 2 of 3 has 2 for found"));
}

TEST_F(Framing, WrongTextAnswersAreNamed) {
  const auto error = [this](std::string bytes) {
    return ErrorOf([&] { Read(Asked(false, false), true, std::move(bytes)); });
  };
  EXPECT_THAT(error("1 2 3\n1 2\n1 2 3\n"),
              HasSubstr("row 2 of 3 has 2 numbers, and those before 3"));
  EXPECT_THAT(error("1 2 3 4 5\n"), HasSubstr("row 1 of 3 has 5 numbers, not 3 of a point"));
  EXPECT_THAT(error("1 2 x3\n"), HasSubstr("row 1 of 3 has 'x3' for a number"));
  EXPECT_THAT(error("\n1 2 3\n1 2 3\n"), HasSubstr("row 1 of 3 has 0 numbers, not 3 of a point"));
  EXPECT_THAT(error("1 2 3\n\n"), HasSubstr("row 2 of 3 has 0 numbers"));
  EXPECT_THAT(error("1 2 1e999\n1 2 3\n1 2 3\n"),
              HasSubstr("row 1 of 3 has a point that is not finite"));
  EXPECT_THAT(error(std::string(1 << 17, '1')), HasSubstr("row 1 of 3 does not end"));
}

TEST(FramingNumbers, AreReadWhole) {
  double number = 7;
  for (const auto& [text, value] :
       {std::pair{"+1.5", 1.5}, {"-.25", -0.25}, {"1e-400", 0.0}, {"2.", 2.0}}) {
    EXPECT_TRUE(ParseNumber(text, &number)) << text;
    EXPECT_EQ(number, value) << text;
  }
  EXPECT_TRUE(ParseNumber("-inf", &number) && std::isinf(number));
  for (const char* text : {"", "+", "+-1", "--1", "1,5", "0x10", "1d3", "1 ", "."}) {
    EXPECT_FALSE(ParseNumber(text, &number)) << text;
  }
}

TEST(FramingGreeting, SaysEverything) {
  const Greeting greeting = ParseGreeting(
      "stellate-oracle 1 text  k=1 d=2 tangents=1 flats=0 sizes=1 box=-1,-2:1,2 seeds=1,0;0,1.5 "
      "about=of radius 1,  k=2 at most\r");
  EXPECT_TRUE(greeting.text && greeting.tangents && greeting.sizes && !greeting.flats);
  EXPECT_EQ(greeting.dimension, 1);
  EXPECT_EQ(greeting.ambient_dimension, 2);
  EXPECT_EQ(greeting.box->lower, Eigen::Vector2d(-1, -2));
  EXPECT_EQ(greeting.box->upper, Eigen::Vector2d(1, 2));
  EXPECT_EQ(greeting.seeds.col(1), Eigen::Vector2d(0, 1.5));
  EXPECT_EQ(greeting.about, "of radius 1, k=2 at most");
  const Greeting bare = ParseGreeting("stellate-oracle 1 binary");
  EXPECT_FALSE(bare.text || bare.dimension || bare.box || bare.seeds.size() > 0);
}

TEST(FramingGreeting, WrongOnesAreNamed) {
  const auto error = [](const std::string& line) { return ErrorOf([&] { ParseGreeting(line); }); };
  EXPECT_THAT(error("GNU Octave, version 7.3.0"), HasSubstr("banner"));
  EXPECT_THAT(error(""), HasSubstr("first line has to be"));
  EXPECT_THAT(error("stellate-oracle 1"), HasSubstr("'binary' or 'text'"));
  EXPECT_THAT(error("stellate-oracle 2 text"), HasSubstr("version '2'"));
  for (const std::string word :
       {"tangent=1", "k=", "k=-1", "k=2.0", "k=99999999999", "tangents=2", "box=1,1:0,0",
        "box=1:2:3", "box=1,2:3", "box=nan,0:1,1", "seeds=", "seeds=1,2;3", "=", "k"}) {
    EXPECT_THAT(error("stellate-oracle 1 text " + word), HasSubstr("its first line: '")) << word;
  }
}

// A face of the second of two walls, in the plane.
TEST(Walls, OfABatchAndItsAnswer) {
  const Eigen::MatrixXd point = Eigen::Vector2d(0.5, 2);
  Question question{1, point};
  question.walls = 2;
  question.face = {1};
  EXPECT_EQ(ToBytes(question, true), "face 1 0 0 1\n0.5 2\n");
  EXPECT_EQ(ToBytes(question, false), Raw(std::uint32_t{3}, std::uint32_t{1}, std::uint32_t{0},
                                          std::uint32_t{1}, std::uint32_t{1}) +
                                          Raw(point));
  const Eigen::MatrixXd clearances = Eigen::Vector2d(3, 4), conormal = Eigen::Vector2d(0, -1);
  const std::string head = Raw(std::uint32_t{1}, std::uint32_t{16});
  for (const bool text : {false, true}) {
    const Answer answer =
        Read(question, text,
             text ? "0.5 2 3 4 0 -1\n" : head + Raw(point) + Raw(clearances) + Raw(conormal));
    EXPECT_EQ(answer.points, point);
    EXPECT_EQ(answer.clearances, clearances);
    EXPECT_EQ(answer.conormals, conormal);
  }
  EXPECT_THAT(ErrorOf([&] { Read(question, true, "0.5 2\n"); }), HasSubstr("4 of walls"));
  EXPECT_THAT(ErrorOf([&] { Read(question, true, "0.5 2 3 4 0 nan\n"); }),
              HasSubstr("a conormal that is not finite"));
  EXPECT_THAT(
      ErrorOf([&] { Read(question, false, Raw(std::uint32_t{1}, std::uint32_t{0}) + Raw(point)); }),
      HasSubstr("has no walls"));
  EXPECT_EQ(Read(question, true, "-\n").clearances, Eigen::MatrixXd::Zero(2, 1));
  EXPECT_EQ(ParseGreeting("stellate-oracle 1 text k=2 d=2 walls=64").walls, 64);
  EXPECT_THAT(ErrorOf([] { ParseGreeting("stellate-oracle 1 text walls=65"); }),
              HasSubstr("up to 64"));
}

}  // namespace
}  // namespace stellate::pipe
