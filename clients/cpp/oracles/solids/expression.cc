// Solids in words: the grammar of `stellate mesh --solid`, by recursive descent.
//
//   solid  = part { operator part }            ~ first, then -, &, ^, |, as in C++ and Python
//   part   = "~" part | name "(" arguments ")" | "(" solid ")", each { "." name "(" arguments ")" }
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <variant>

#include "oracles/solids/arguments.h"
#include "stellate/solids.h"

namespace stellate::solids {
namespace {

using Eigen::VectorXd;

constexpr int kDeepest = 100;    // parentheses within each other
constexpr int kMostParts = 500;  // what has more walls than may be meshed has more than enough
constexpr int kMostExclusives = 10;

struct Primitive {
  std::string_view name;
  Solid (*make)(Arguments& a);
};

// Arguments are taken in the order of their places, named ones wherever they stand.
constexpr std::array kPrimitives = {
    Primitive{"ball",
              [](Arguments& a) {
                const double radius = a.Number("radius", 1);
                return Ball(radius, a.PointOrOrigin("at"));
              }},
    Primitive{"box",
              [](Arguments& a) {
                const VectorXd lower = a.Point("lower", true);
                return Box(lower, a.Point("upper", true));
              }},
    Primitive{"halfspace",
              [](Arguments& a) {
                const VectorXd normal = a.Point("normal");
                return HalfSpace(normal, a.Number("offset", 0));
              }},
    Primitive{"cylinder",
              [](Arguments& a) {
                const Eigen::Vector3d axis = a.Axis(), at = a.Place();
                const double radius = a.Number("radius", 1);
                return Cylinder(radius, a.NumberIfAny("height"), axis, at);
              }},
    Primitive{"cone",
              [](Arguments& a) {
                const Eigen::Vector3d axis = a.Axis(), at = a.Place();
                const double radius = a.Number("radius"), height = a.Number("height");
                return Cone(radius, height, a.Number("top", 0), axis, at);
              }},
    Primitive{"torus",
              [](Arguments& a) {
                const Eigen::Vector3d axis = a.Axis(), at = a.Place();
                const double major = a.Number("major", 1);
                return Torus(major, a.Number("minor", 0.4), axis, at);
              }},
    Primitive{"capsule",
              [](Arguments& a) {
                const Eigen::Vector3d start = a.PointOfSpace("start"), end = a.PointOfSpace("end");
                return Capsule(start, end, a.Number("radius"));
              }},
    Primitive{"blend",
              [](Arguments& a) {
                const Solid first = a.Part("first solid"), second = a.Part("second solid");
                const double radius = a.Number("radius");
                return Blend(first, second, radius, a.HowJoined());
              }},
};

struct Method {
  std::string_view name;
  Solid (*apply)(const Solid& of, Arguments& a);
};

constexpr std::array kMethods = {
    Method{"at", [](const Solid& of, Arguments& a) { return of.At(a.Point("point")); }},
    Method{"rotated",
           [](const Solid& of, Arguments& a) {
             const Eigen::Vector3d axis = a.Axis().normalized();
             const double degrees = a.Number("degrees");
             return of.Rotated(
                 Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis).toRotationMatrix());
           }},
    Method{"scaled", [](const Solid& of, Arguments& a) { return of.Scaled(a.Number("factor")); }},
    Method{"offset", [](const Solid& of, Arguments& a) { return of.Offset(a.Number("distance")); }},
};

struct Synonym {
  std::string_view name, ours;
};

// What other programs call these.
constexpr std::array kElsewhere = {
    Synonym{"sphere", "ball(1)"},
    Synonym{"cube", "box(-1, 1)"},
    Synonym{"plane", "halfspace((0, 0, 1))"},
    Synonym{"union", "a | b"},
    Synonym{"difference", "a - b"},
    Synonym{"subtract", "a - b"},
    Synonym{"intersection", "a & b"},
    Synonym{"intersect", "a & b"},
    Synonym{"complement", "~a"},
    Synonym{"translate", "a.at(1, 2, 3)"},
    Synonym{"rotate", "a.rotated(z, 90)"},
    Synonym{"scale", "a.scaled(2)"},
};

template <typename Table>
std::string NamesOf(const Table& table) {
  std::string names;
  for (const auto& entry : table) {
    names += (names.empty()             ? ""
              : &entry == &table.back() ? " or "
                                        : ", ") +
             std::string(entry.name);
  }
  return names;
}

class Parser {
 public:
  explicit Parser(std::string_view text) : text_(text) {}

  Solid Whole() {
    Solid solid = Joined(0);
    if (!AtEnd()) Expected("an operator, & | - or ^, or the end");
    return solid;
  }

 private:
  // The operators, those that bind least first.
  static constexpr std::string_view kOperators = "|^&-";

  Solid Joined(size_t level) {
    if (level == kOperators.size()) return Part();
    Solid solid = Joined(level + 1);
    while (Next(kOperators[level])) {
      const int column = Column();
      if (kOperators[level] == '^' && ++exclusives_ > kMostExclusives) {
        throw ExpressionError(column, "there are more than " + std::to_string(kMostExclusives) +
                                          " ^, and each doubles the solid");
      }
      const Solid other = Joined(level + 1);
      solid = Guarded(column, [&] { return Join(kOperators[level], solid, other); });
    }
    return solid;
  }

  static Solid Join(char how, const Solid& a, const Solid& b) {
    if (how == '|') return a | b;
    if (how == '^') return a ^ b;
    return how == '&' ? a & b : a - b;
  }

  Solid Part() {
    if (++depth_ > kDeepest) {
      throw ExpressionError(Column(),
                            "parentheses are more than " + std::to_string(kDeepest) + " deep");
    }
    Solid solid = Next('~') ? ~Part() : Moved(Plain());
    --depth_;
    return solid;
  }

  Solid Plain() {
    if (Next('(')) {
      Solid solid = Joined(0);
      Insist(')');
      return solid;
    }
    const int column = Column();
    const std::string name = Word();
    const auto* const known = std::find_if(kPrimitives.begin(), kPrimitives.end(),
                                           [&](const Primitive& p) { return p.name == name; });
    if (known == kPrimitives.end()) {
      at_ = static_cast<size_t>(column) - 1;
      Expected("a solid: " + NamesOf(kPrimitives) + ", ~ or a parenthesis", HintFor(name));
    }
    if (++parts_ > kMostParts) {
      throw ExpressionError(column, "there are more than " + std::to_string(kMostParts) + " parts");
    }
    Arguments arguments = ArgumentsOf(name, column);
    return Guarded(column, [&] {
      Solid solid = known->make(arguments);
      arguments.Finish();
      return solid;
    });
  }

  Solid Moved(Solid solid) {
    while (Next('.')) {
      const int column = Column();
      const std::string name = Word();
      const auto* const known = std::find_if(kMethods.begin(), kMethods.end(),
                                             [&](const Method& m) { return m.name == name; });
      if (known == kMethods.end()) {
        at_ = static_cast<size_t>(column) - 1;
        Expected(NamesOf(kMethods), HintFor(name));
      }
      Arguments arguments = ArgumentsOf(name, column);
      solid = Guarded(column, [&] {
        Solid moved = known->apply(solid, arguments);
        arguments.Finish();
        return moved;
      });
    }
    return solid;
  }

  // What a maker refuses is refused at the place of its name.
  template <typename Make>
  static Solid Guarded(int column, const Make& make) {
    try {
      return make();
    } catch (const ExpressionError&) {
      throw;
    } catch (const std::invalid_argument& refusal) {
      throw ExpressionError(column, refusal.what());
    }
  }

  Arguments ArgumentsOf(const std::string& name, int column) {
    Insist('(');
    std::vector<Argument> given;
    if (!Next(')')) {
      do {
        given.push_back(OneArgument());
      } while (Next(','));
      Insist(')');
    }
    // .at(1, 2, 3) is .at((1, 2, 3)).
    const auto is_number = [](const Argument& a) {
      return a.name.empty() && std::holds_alternative<double>(a.value);
    };
    if (name == "at" && given.size() > 1 && std::all_of(given.begin(), given.end(), is_number)) {
      VectorXd point(static_cast<Eigen::Index>(given.size()));
      for (size_t i = 0; i < given.size(); ++i) {
        point[static_cast<Eigen::Index>(i)] = std::get<double>(given[i].value);
      }
      given.front().value = point;
      given.resize(1, given.front());
    }
    return {name, column, std::move(given)};
  }

  Argument OneArgument() {
    Skip();
    Argument argument;
    argument.column = Column();
    const size_t start = at_;
    if (std::isalpha(Peek()) != 0) {
      const std::string word = Word();
      if (Next('=')) {
        argument.name = word;
        argument.column = Column();
      } else {
        at_ = start;
      }
    }
    const size_t begin = at_;
    argument.value = Value();
    argument.text = std::string(text_.substr(begin, at_ - begin));
    return argument;
  }

  std::variant<double, VectorXd, Solid, std::string> Value() {
    Skip();
    if (const std::optional<double> number = NumberIfAny()) return *number;
    if (const std::optional<VectorXd> point = PointIfAny()) return *point;
    if (Peek() == '~' || Peek() == '(') return Joined(0);
    if (std::isalpha(Peek()) == 0) Expected("a number, a point, a word or a solid");
    const size_t start = at_;
    std::string word = Word();
    if (Peek() != '(') return word;
    at_ = start;
    return Joined(0);
  }

  std::optional<double> NumberIfAny() {
    Skip();
    double value = 0;
    const char* const first = text_.data() + at_;
    const size_t sign = at_ < text_.size() && text_[at_] == '+' ? 1 : 0;
    const auto [end, status] = std::from_chars(first + sign, text_.data() + text_.size(), value);
    if (status != std::errc() || std::isalpha(static_cast<unsigned char>(*(first + sign))) != 0) {
      return std::nullopt;
    }
    at_ = static_cast<size_t>(end - text_.data());
    return value;
  }

  // (1, 2): a parenthesis that begins with a number and a comma.
  std::optional<VectorXd> PointIfAny() {
    const size_t start = at_;
    std::vector<double> numbers;
    if (Next('(')) {
      while (const std::optional<double> number = NumberIfAny()) {
        numbers.push_back(*number);
        if (!Next(',')) break;
      }
    }
    if (numbers.empty()) {
      at_ = start;
      return std::nullopt;
    }
    Insist(')');
    return VectorXd(Eigen::Map<VectorXd>(numbers.data(), std::ssize(numbers)));
  }

  std::string Word() {
    Skip();
    const size_t start = at_;
    while (std::isalnum(Peek()) != 0 || Peek() == '_') ++at_;
    return std::string(text_.substr(start, at_ - start));
  }

  bool Next(char wanted) {
    Skip();
    if (Peek() != wanted) return false;
    ++at_;
    Skip();
    return true;
  }

  void Insist(char wanted) {
    if (!Next(wanted)) Expected(Quoted(std::string(1, wanted)));
  }

  static std::string HintFor(std::string_view name) {
    const auto* const known = std::find_if(kElsewhere.begin(), kElsewhere.end(),
                                           [&](const Synonym& s) { return s.name == name; });
    return known == kElsewhere.end() ? "" : "; write " + std::string(known->ours);
  }

  [[noreturn]] void Expected(const std::string& what, const std::string& hint = "") {
    Skip();
    std::string there = "the expression ends";
    if (!AtEnd()) {
      const size_t start = at_;
      const std::string word = Word();
      there = "there is " + Quoted(word.empty() ? text_.substr(start, 1) : word);
      at_ = start;
    }
    throw ExpressionError(Column(), "expected " + what + ", and " + there + hint);
  }

  void Skip() {
    while (at_ < text_.size() && std::isspace(Peek()) != 0) ++at_;
  }
  int Peek() const { return AtEnd() ? 0 : static_cast<unsigned char>(text_[at_]); }
  bool AtEnd() const { return at_ >= text_.size(); }
  int Column() const { return static_cast<int>(at_) + 1; }

  std::string_view text_;
  size_t at_ = 0;
  int depth_ = 0, parts_ = 0, exclusives_ = 0;
};

}  // namespace

Expected<Solid> ParseSolid(std::string_view expression) {
  try {
    return Parser(expression).Whole();
  } catch (const ExpressionError& error) {
    return Fail(ErrorCode::kRefused, "column " + std::to_string(error.column()) + ": " +
                                         error.what() + "\n" + std::string(expression) + "\n" +
                                         std::string(static_cast<size_t>(error.column()) - 1, ' ') +
                                         "^");
  }
}

}  // namespace stellate::solids
