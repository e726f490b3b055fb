// Composed solids: the same walls and labels as Python's, what they refuse, and how they are named.
#include "stellate/solids.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace stellate::solids {
namespace {

using Eigen::MatrixXd, Eigen::Vector3d, Eigen::VectorXd;
using google::protobuf::ListValue, google::protobuf::Struct;

const Vector3d kOne = Vector3d::Ones(), kX = Vector3d::UnitX(), kZ = Vector3d::UnitZ();

Struct Shared() {
  std::ifstream file(SHARED_FACTS "/solids.json");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Struct shared;
  EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(text, &shared).ok());
  return shared;
}

const ListValue& List(const Struct& of, const std::string& name) {
  return of.fields().at(name).list_value();
}

std::string Signs(const auto& labels) {
  std::string signs;
  for (const auto label : labels) {
    const int number = static_cast<std::int8_t>(label);
    signs += number < 0 ? "-" : std::to_string(number);
  }
  return signs;
}

// "box(-1, 1)", or "name=box(-1, 1); other=...".
std::unique_ptr<Composed> Parsed(const std::string& text) {
  if (text.find(';') == std::string::npos) return std::make_unique<Solid>(ParseSolid(text).value());
  std::vector<std::pair<std::string, Solid>> materials;
  for (size_t at = 0; at < text.size();) {
    const size_t equals = text.find('=', at), end = std::min(text.find(';', at), text.size());
    const size_t first = text.find_first_not_of(' ', at);
    materials.emplace_back(text.substr(first, equals - first),
                           ParseSolid(text.substr(equals + 1, end - equals - 1)).value());
    at = end + 1;
  }
  return std::make_unique<Labels>(std::move(materials));
}

TEST(Solids, HaveTheWallsAndLabelsThatPythonHas) {
  const Struct shared = Shared();
  int seen = 0;
  for (const auto& value : List(shared, "cases").values()) {
    const Struct& want = value.struct_value();
    const std::string expression = want.fields().at("expression").string_value();
    SCOPED_TRACE(expression);
    const std::unique_ptr<Composed> solid = Parsed(expression);
    const int d = solid->dimension();
    MatrixXd places(d, List(shared, "places").values_size());
    for (int j = 0; j < places.cols(); ++j) {
      const ListValue& place = List(shared, "places").values(j).list_value();
      for (int i = 0; i < d; ++i) places(i, j) = place.values(i).number_value();
    }
    for (int i = 0; i < d; ++i) {
      EXPECT_NEAR(solid->bounding_box()->lower[i], List(want, "box").values(i).number_value(),
                  1e-12);
      EXPECT_NEAR(solid->bounding_box()->upper[i], List(want, "box").values(d + i).number_value(),
                  1e-12);
    }
    const MatrixXd clearances = solid->Clearances(places);
    ASSERT_EQ(solid->walls(), List(want, "clearances").values_size());
    for (int wall = 0; wall < solid->walls(); ++wall) {
      for (int j = 0; j < places.cols(); ++j) {
        const ListValue& of_wall = List(want, "clearances").values(wall).list_value();
        EXPECT_NEAR(clearances(wall, j), of_wall.values(j).number_value(), 1e-12) << wall;
      }
    }
    EXPECT_EQ(Signs(solid->labels()), want.fields().at("labels").string_value());
    ++seen;
    const auto* const one = dynamic_cast<const Solid*>(solid.get());
    ASSERT_EQ(one != nullptr, want.fields().contains("table"));
    if (one == nullptr) continue;
    const LabelTable table = one->Table();
    EXPECT_EQ(Signs(table.labels), want.fields().at("table").string_value());
    for (size_t wall = 0; wall < table.walls.size(); ++wall) {
      for (int j = 0; j < places.cols(); ++j) {
        const ListValue& values = List(want, "walls").values(static_cast<int>(wall)).list_value();
        EXPECT_NEAR(table.walls[wall].g(places.col(j)), values.values(j).number_value(), 1e-12);
      }
    }
    for (int j = 0; j < places.cols(); ++j) {
      EXPECT_EQ(one->Contains(places.col(j)), List(want, "inside").values(j).bool_value()) << j;
    }
  }
  EXPECT_GE(seen, 19);
}

Phase NearTo(const Vector3d& centre, double lowered = 0) {
  return {[=](const VectorXd& x) { return -(x - centre).squaredNorm() - lowered; },
          [=](const VectorXd& x) -> VectorXd { return -2 * (x - centre); }};
}

TEST(Phases, HaveTheWallsLabelsAndClosuresThatPythonHas) {
  const Struct shared = Shared();
  int seen = 0;
  for (const auto& value : List(shared, "phases").values()) {
    const Struct& want = value.struct_value();
    const std::string within = want.fields().at("within").string_value();
    SCOPED_TRACE(within);
    std::vector<Phase> grains;
    for (const auto& numbers : List(want, "grains").values()) {
      const ListValue& grain = numbers.list_value();
      const auto at = [&grain](int i) { return grain.values(i).number_value(); };
      grains.push_back(NearTo({at(0), at(1), at(2)}, at(3)));
    }
    Phases phases(grains, ParseSolid(within).value());
    EXPECT_EQ(Signs(phases.labels()), want.fields().at("labels").string_value());
    const std::vector<Walls> closures = phases.closures();
    ASSERT_EQ(std::ssize(closures), List(want, "closures").values_size());
    for (int i = 0; i < std::ssize(closures); ++i) {
      const ListValue& walls = List(want, "closures").values(i).list_value();
      ASSERT_EQ(walls.values_size(), 3);
      for (int j = 0; j < 3; ++j) {
        EXPECT_EQ(closures[static_cast<size_t>(i)][static_cast<size_t>(j)],
                  walls.values(j).number_value());
      }
    }
    ASSERT_EQ(phases.walls(), List(want, "clearances").values_size());
    for (int j = 0; j < List(shared, "places").values_size(); ++j) {
      const ListValue& place = List(shared, "places").values(j).list_value();
      Vector3d x;
      for (int i = 0; i < 3; ++i) x[i] = place.values(i).number_value();
      EXPECT_EQ(phases.LabelAt(x), List(want, "label_at").values(j).number_value());
      const MatrixXd clearances = phases.Clearances(x);
      for (int wall = 0; wall < phases.walls(); ++wall) {
        const ListValue& of_wall = List(want, "clearances").values(wall).list_value();
        EXPECT_NEAR(clearances(wall, 0), of_wall.values(j).number_value(), 1e-12) << wall;
      }
    }
    ++seen;
  }
  EXPECT_GE(seen, 3);
}

// The edge of three phases is asked for by all three walls, of which any two are enough.
TEST(Phases, FindTheEdgesAndCornersWhereSeveralMeet) {
  const std::vector<Vector3d> centres = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -0.9}, {-1, -1.1, 1}};
  std::vector<Phase> grains;
  for (const Vector3d& centre : centres) grains.push_back(NearTo(centre));
  Phases phases(grains, Ball(1));
  const Vector3d x(0.3, 0.2, -0.1);
  for (const Walls& face : {Walls{0, 1, 3}, Walls{0, 1, 2, 3, 4, 5}}) {
    const Answer answer = phases.FacePoint(x, face);
    ASSERT_TRUE(answer.IsFound(0));
    for (const int wall : face) {
      EXPECT_NEAR(phases.Clearances(answer.points)(wall, 0), 0, 1e-12) << wall;
    }
    EXPECT_EQ(phases.Conormals(answer.points, face).rows(), 3 * std::ssize(face));
  }
  EXPECT_TRUE(phases.region_names().empty());
  grains[1].name = "salt";
  EXPECT_EQ(Phases(grains, Ball(1)).region_names(), (std::vector<std::string>{"", "salt", "", ""}));
}

// By differences of their values, at random points.
TEST(Solids, WallsKnowTheirGradientsAndAreDistances) {
  const MatrixXd turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Solid smooth = Implicit([](const VectorXd& x) { return 1 - x.norm(); },
                                [](const VectorXd& x) -> VectorXd { return -x.normalized(); });
  for (const Solid& plain :
       {Ball(0.8), Box(-kOne, kOne), Cylinder(0.6, 1.1, Vector3d(1, 2, 3)), HalfSpace(kX, 0.3),
        Cone(0.8, 1.2, 0.3), Torus(0.8, 0.3, kX), Capsule(-kX, kZ, 0.4), smooth,
        Blend(Ball(0.6), Ball(0.5, 0.8 * kX), 0.2), ~Ball(0.8)}) {
    const Solid solid = plain.Scaled(1.3).Rotated(turn).At(Vector3d(0.2, -0.1, 0.3));
    std::mt19937 random(1);
    std::uniform_real_distribution<double> number(-1.5, 1.5);
    for (const oracles::Wall& wall : solid.HalfWalls()) {
      for (int tries = 0; tries < 50; ++tries) {
        const Vector3d x(number(random), number(random), number(random));
        const VectorXd slope = wall.gradient(x);
        for (int i = 0; i < 3; ++i) {
          const Vector3d step = 1e-6 * Vector3d::Unit(i);
          EXPECT_NEAR(slope[i], (wall.g(x + step) - wall.g(x - step)) / 2e-6, 1e-5);
        }
      }
    }
  }
}

std::string RefusalOf(const auto& make) {
  try {
    make();
  } catch (const std::invalid_argument& refusal) {
    return refusal.what();
  }
  return "none";
}

TEST(Solids, WhatCannotBeIsRefusedInWords) {
  const Solid box = Box(-kOne, kOne), disc = Ball(1, Eigen::Vector2d::Zero());
  Solid many = Ball();
  for (int i = 0; i < 17; ++i) many = many | Ball(0.1, 3 * i * kX);
  const std::vector<std::pair<std::string, std::string>> refusals = {
      {"radius has to be a length above 0, and is -1", RefusalOf([] { Ball(-1); })},
      {"the lower one first", RefusalOf([] { Box(kOne, -kOne); })},
      {"a normal other than 0", RefusalOf([] { HalfSpace(0 * kX); })},
      {"an axis has to be a vector other than 0", RefusalOf([] { Cylinder(1, 1, 0 * kX); })},
      {"minor < major, not 2 and 1", RefusalOf([] { Torus(1, 2); })},
      {"two points that differ", RefusalOf([] { Capsule(kX, kX, 1); })},
      {"takes a function", RefusalOf([] { Implicit({}); })},
      {"a solid of R^3 and one of R^2 cannot be joined", RefusalOf([&] { box | disc; })},
      {"an orthogonal matrix, 3 x 3",
       RefusalOf([&] { box.Rotated(2 * Eigen::Matrix3d::Identity()); })},
      {"Offset takes solids of one wall", RefusalOf([&] { box.Offset(0.1); })},
      {"nothing would be left", RefusalOf([] { Ball().Offset(-1); })},
      {"Blend takes solids of one wall", RefusalOf([&] { Blend(box, Ball(), 0.1); })},
      {"goes on without end", RefusalOf([] { Cylinder().walls(); })},
      {"the solid is empty: no point", RefusalOf([] { (Ball() & ~Ball()).walls(); })},
      {"all of space", RefusalOf([] { (Ball() | ~Ball()).walls(); })},
      {"none has one sign throughout", RefusalOf([] { (Ball() | Ball(1, kX)).HalfWalls(); })},
      {"of more than 16 only what is written as an intersection", RefusalOf([&] { many.walls(); })},
      {"there may be 1 to 127", RefusalOf([] { Labels({}); })},
      {"two materials 'a'", RefusalOf([] {
         Labels({{"a", Ball()}, {"a", Ball()}});
       })},
      {"nothing of the material 'a'", RefusalOf([&] {
         Labels({{"a", Ball()}, {"b", box}}).walls();
       })},
      {"the material 'b' is a solid of R^2", RefusalOf([&] {
         Labels({{"a", Ball()}, {"b", disc}});
       })},
      {"no material 'c'", RefusalOf([] {
         Labels({{"a", Ball()}}).LabelOf("c");
       })},
      {"two to six functions, and these are 1", RefusalOf([] { Phases({NearTo(kX)}, Ball()); })},
      {"one of them is none", RefusalOf([] {
         Phases({NearTo(kX), {}}, Ball());
       })},
      {"6 phases have 15 walls, and what they fill has 6; there may be 16 together",
       RefusalOf([&] { Phases(std::vector<Phase>(6, NearTo(kX)), box).walls(); })},
      {"goes on without end", RefusalOf([] {
         Phases({NearTo(kX), NearTo(kZ)}, ~Ball()).walls();
       })},
      {"there is no wall 2", RefusalOf([&] {
         oracles::Solid(std::vector<oracles::Wall>(2, oracles::Ball(0 * kX, 1)), {-kOne, kOne}, {},
                        {0, 1, 2, 3}, {{0, 1, 2}});
       })},
  };
  for (const auto& [words, refusal] : refusals) {
    EXPECT_NE(refusal.find(words), std::string::npos) << words << "\n" << refusal;
  }
  EXPECT_THROW(Implicit([](const VectorXd& x) { return x[0]; },
                        [](const VectorXd& /*x*/) { return VectorXd(VectorXd::Ones(2)); })
                   .HalfWalls()[0]
                   .gradient(kOne),
               OracleError);
}

// The oracle is made once, by the thread that asks first.
TEST(Solids, SeveralThreadsMayAskACopyFirst) {
  const Solid block = (Box(-kOne, kOne) & Ball(1.3)) - Cylinder(0.5, {}, kX);
  const Solid part = block | Ball(0.45, 0.9 * kOne);
  std::vector<std::thread> threads;
  std::vector<int> walls(4, 0);
  for (int& count : walls) {
    threads.emplace_back([copy = part, &count] { count = copy.walls(); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(walls, std::vector<int>(4, 9));
}

struct WrongExpression {
  const char* text;
  int column;
  const char* words;
};

TEST(SolidExpressions, SayWhereTheyAreWrongAndWhatWasExpected) {
  const std::string deep(150, '('), chain = std::string(600, '~') + "ball()";
  const std::vector<WrongExpression> wrong = {
      {"", 1, "expected a solid: ball, box, "},
      {"   ", 4, "and the expression ends"},
      {"bal(1)", 1, "and there is 'bal'"},
      {"sphere(2) - ball(1)", 1, "and there is 'sphere'; write ball(1)"},
      {"ball(1) | union(ball(1), ball(2))", 11, "there is 'union'; write a | b"},
      {"ball(1).translate(1, 2, 3)", 9, "there is 'translate'; write a.at(1, 2, 3)"},
      {"ball(1", 7, "expected ')', and the expression ends"},
      {"ball 1", 6, "expected '(', and there is '1'"},
      {"ball(1) &", 10, "expected a solid"},
      {"ball(1) & & ball(2)", 11, "and there is '&'"},
      {"ball(1) ball(2)", 9, "expected an operator, & | - or ^, or the end, and there is 'ball'"},
      {"ball(x)", 6, "the radius of ball has to be a number, and is 'x'"},
      {"ball(1, at=2)", 12, "the at of ball has to be a point, (1, 2, 3), and is '2'"},
      {"ball(1, 2)", 9, "the at of ball has to be a point"},
      {"ball(1, (0, 0, 0), 3)", 20, "ball takes no further argument 3"},
      {"ball(1, up=3)", 12, "ball takes no argument up"},
      {"ball(-1)", 1, "the radius has to be a length above 0, and is -1"},
      {"box(1)", 1, "box lacks its upper, a number or a point"},
      {"box(1, -1)", 1, "the lower one first"},
      {"cylinder(w, 1)", 10, "the axis of cylinder has to be x, y, z or a vector of space"},
      {"cylinder((1, 2), 1)", 10, "the axis of cylinder has to be x, y, z or a vector of space"},
      {"capsule((0, 0), (1, 1), 1)", 1, "capsule is of space: its start has 3 numbers, not 2"},
      {"ball(1).moved(2)", 9, "expected at, rotated, scaled or offset, and there is 'moved'"},
      {"box(-1, 1).offset(0.1)", 12, "Offset takes solids of one wall"},
      {"ball(1) | ball(1, at=(0, 0))", 11, "a solid of R^3 and one of R^2 cannot be joined"},
      {"blend(ball(1), 2, 1)", 16, "the second solid of blend has to be a solid, and is '2'"},
      {"ball(at=(1, 2, )", 17, "expected ')', and the expression ends"},
      {"ball(1e999)", 6, "expected"},
      {deep.c_str(), 101, "more than 100 deep"},
      {chain.c_str(), 101, "more than 100 deep"},
      {"ball()^ball()^ball()^ball()^ball()^ball()^ball()^ball()^ball()^ball()^ball()^ball()", 78,
       "more than 10 ^"},
  };
  for (const auto& [text, column, words] : wrong) {
    SCOPED_TRACE(text);
    const Expected<Solid> solid = ParseSolid(text);
    ASSERT_FALSE(solid.has_value());
    EXPECT_EQ(solid.error().code, ErrorCode::kRefused);
    const std::string& what = solid.error().message;
    EXPECT_EQ(what.rfind("column " + std::to_string(column) + ": ", 0), 0u) << what;
    EXPECT_NE(what.find(words), std::string::npos) << what;
    const std::string shown = "\n" + std::string(text) + "\n";
    EXPECT_TRUE(what.ends_with(shown + std::string(static_cast<size_t>(column) - 1, ' ') + "^"));
  }
}

// Random text from the grammar's own pieces: refused in words, or a solid; never anything else.
TEST(SolidExpressions, AnyTextIsASolidOrRefused) {
  const std::vector<std::string> pieces = {
      "ball", "box", "cylinder", "(",    ")",      ",",       "1",       "-1", "x",
      "at",   "=",   "&",        "|",    "-",      "^",       "~",       ".",  ".5",
      " ",    "at(", "blend(",   "\xff", "ball()", "ball(1)", "(1,2,3)", "1e", "inf"};
  std::mt19937 random(7);
  int taken = 0;
  for (int tries = 0; tries < 20'000; ++tries) {
    std::string text;
    for (size_t i = random() % 9; i-- > 0;) text += pieces[random() % pieces.size()];
    const Expected<Solid> solid = ParseSolid(text);
    if (solid) {
      ++taken;
    } else {
      EXPECT_EQ(solid.error().message.rfind("column ", 0), 0u) << solid.error().message;
    }
  }
  EXPECT_GT(taken, 100);
}

}  // namespace
}  // namespace stellate::solids
