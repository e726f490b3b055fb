#include "tests/truth/cases.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <utility>

namespace stellate::truth {
namespace {

class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t n) : engine(seed * 1'000'003 + n) {}
  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine);
  }
  double LogUniform(double low, double high) {
    return std::exp(Uniform(std::log(low), std::log(high)));
  }
  int Int(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine); }
  bool Coin() { return Int(0, 1) == 1; }

  std::mt19937_64 engine;
};

// A gap that may be far below, about or well above epsilon.
double Gap(double epsilon, Dice& dice) { return epsilon * dice.LogUniform(0.03, 12); }

ShapePtr ConcentricSpheres(int k, int count, double gap) {
  std::vector<double> radii;
  for (int i = 0; i < count; ++i) radii.push_back(1 - i * gap);
  return Spheres(k, MatrixXd::Zero(k + 1, count), radii);
}

ShapePtr Section(std::vector<Curve> curves, bool symmetric, int m) {
  return m == 0 ? Curves(std::move(curves)) : Revolution(std::move(curves), symmetric, m);
}

using Maker = std::function<void(Case&, Dice&)>;

void NestedSpheres(Case& c, Dice& dice) {
  const int k = dice.Int(1, 3);
  c.epsilon = dice.Uniform(0.15, 0.4);
  c.shape = ConcentricSpheres(k, dice.Int(2, k == 1 ? 3 : 2), std::min(0.4, Gap(c.epsilon, dice)));
}

void NeighbouringSpheres(Case& c, Dice& dice) {
  const int k = dice.Int(1, 3);
  c.epsilon = dice.Uniform(0.15, 0.5);
  MatrixXd centres = MatrixXd::Zero(k + 1, 2);
  centres(0, 1) = 2 + Gap(c.epsilon, dice);
  c.shape = Spheres(k, centres, {1, 1});
}

void ScatteredSpheres(Case& c, Dice& dice) {
  const int k = dice.Int(1, 2), count = dice.Int(3, 8);
  c.epsilon = dice.Uniform(0.1, 0.4);
  std::vector<double> radii;
  MatrixXd centres = MatrixXd::Zero(k + 1, count);
  for (int i = 0; i < count; ++i) {
    radii.push_back(i == 0 ? 1 : c.epsilon * dice.LogUniform(0.5, 4));
    // Far enough from all the others, as far out as that needs.
    for (double out = 0; i > 0; out += 0.05) {
      VectorXd at(k + 1);
      for (int j = 0; j <= k; ++j) at[j] = dice.Uniform(-1.5 - out, 1.5 + out);
      double gap = 1e9;
      for (int j = 0; j < i; ++j)
        gap = std::min(gap, (at - centres.col(j)).norm() - radii[static_cast<std::size_t>(i)] -
                                radii[static_cast<std::size_t>(j)]);
      if (gap < 0.3 * c.epsilon) continue;
      centres.col(i) = at;
      break;
    }
  }
  c.shape = Spheres(k, centres, radii);
}

void Bubble(Case& c, Dice& dice) {
  const int k = dice.Int(1, 2);
  c.epsilon = dice.Uniform(0.1, 0.4);
  const double radius = c.epsilon * dice.LogUniform(0.2, 2);
  MatrixXd centres = MatrixXd::Zero(k + 1, 2);
  centres(dice.Int(0, k), 1) = 1 + radius + Gap(c.epsilon, dice);
  c.shape = Spheres(k, centres, {1, radius});
  c.seeds = dice.Int(0, 3) > 0;
}

void Knots(Case& c, Dice& dice) {
  static constexpr std::pair<int, int> kKnots[] = {{2, 3}, {2, 5}, {2, 7}, {3, 4}, {3, 2}, {5, 2}};
  const auto [p, q] = kKnots[dice.Int(0, 5)];
  c.epsilon = dice.Uniform(0.1, 0.6);
  c.shape = Curves({TorusCurve(p, q, std::clamp(Gap(c.epsilon, dice), 0.02, 0.6))});
}

void Links(Case& c, Dice& dice) {
  const int q = dice.Int(1, 3), strands = dice.Int(2, 3);
  c.epsilon = dice.Uniform(0.1, 0.6);
  const double tube = std::clamp(Gap(c.epsilon, dice), 0.02, 0.6);
  std::vector<Curve> curves;
  for (int i = 0; i < strands; ++i)
    curves.push_back(TorusCurve(1, q, tube, 2 * std::numbers::pi * i / strands));
  c.shape = Curves(std::move(curves));
}

void NestedTori(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.1, 0.25);
  const double gap = std::min(0.3, Gap(c.epsilon, dice));
  c.shape = Revolution({Circle(1, 0, 0.5), Circle(1, 0, 0.5 - gap)}, false, 1);
}

// r = 1 + b cos 2t: pinched for b near 1, so that a neck or a gap is left. Turned about one axis it
// is a neck, about the other a dimple.
void Peanuts(Case& c, Dice& dice) {
  const int m = dice.Int(0, 2);
  c.epsilon = dice.Uniform(0.15, m == 2 ? 0.4 : 0.3);
  const double waist = std::min(0.5, Gap(c.epsilon, dice));
  c.shape = Section({StarShaped(0, 0, {1, 0, dice.Coin() ? waist - 1 : 1 - waist})}, true, m);
}

// A ring whose hole nearly closes, or whose tube is thin.
void Rings(Case& c, Dice& dice) {
  const int m = dice.Int(1, 2);
  c.epsilon = dice.Uniform(0.15, m == 2 ? 0.4 : 0.3);
  const double size = std::min(0.5, Gap(c.epsilon, dice));
  const bool thin = dice.Coin();
  c.shape = Revolution({Circle(1, 0, thin ? size : 1 - size)}, false, m);
}

// r = 1 + b cos 2t with b < 1/5 and stretched: flat ellipsoids and needles.
void Pancakes(Case& c, Dice& dice) {
  const int m = dice.Int(0, 2);
  c.epsilon = dice.Uniform(0.15, m == 2 ? 0.4 : 0.3);
  const double flat = std::min(0.8, Gap(c.epsilon, dice));
  MatrixXd cosines = MatrixXd::Zero(2, 2), sines = cosines;
  const bool needle = m > 0 && dice.Coin();
  cosines(0, 1) = needle ? flat : 1;
  sines(1, 1) = needle ? 1 : flat;
  c.shape = Section({Curve(cosines, sines)}, true, m);
}

void Ripples(Case& c, Dice& dice) {
  const int m = dice.Int(0, 1), waves = 2 * dice.Int(3, 9);
  c.epsilon = dice.Uniform(0.15, 0.4);
  std::vector<double> radial(static_cast<std::size_t>(waves) + 1, 0);
  radial.front() = 1;
  radial.back() = std::min(0.3, c.epsilon * dice.LogUniform(0.02, 0.8));
  c.shape = Section({StarShaped(0, 0, radial)}, true, m);
}

void Products(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.2, 0.35);
  const double gap = std::min(0.4, Gap(c.epsilon, dice));
  const ShapePtr circle = Curves({Circle(0, 0, 0.8)});
  const ShapePtr pair =
      dice.Coin() ? ConcentricSpheres(1, 2, gap) : Curves({StarShaped(0, 0, {1, 0, 1 - gap})});
  c.shape = Product(pair, circle);
}

void CloseKnotTimesCircle(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.2, 0.4);
  c.shape = Product(Curves({TorusCurve(2, 3, std::clamp(Gap(c.epsilon, dice), 0.03, 0.5))}),
                    Curves({Circle(0, 0, 0.5)}));
}

void Wires(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.1, 0.4);
  c.shape = WireAsCurve(c.epsilon * dice.LogUniform(0.01, 0.4));
  c.tangents = true;
}

void Shells(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.15, 0.4);
  c.shape = ShellAsSurface(c.epsilon * dice.LogUniform(0.01, 0.4));
  c.tangents = true;
}

void Holes(Case& c, Dice& dice) {
  c.epsilon = dice.Uniform(0.15, 0.4);
  c.hole = std::min(0.7, c.epsilon * dice.LogUniform(0.1, 3));
  c.shape = SphereWithoutCap(c.hole);
}

// Voids in a ball, from far below epsilon on, and as near to its skin: walls of their own, or one
// wall together with the skin.
void VoidOf(Case& c, Dice& dice, bool one_wall) {
  const int d = dice.Int(2, 3);
  c.epsilon = dice.Uniform(0.15, 0.4);
  c.tangents = true;
  const double radius = std::min(0.3, c.epsilon * dice.LogUniform(0.05, 2));
  const double gap = std::min(0.3, c.epsilon * dice.LogUniform(0.1, 2));
  VectorXd centre(d);
  for (int i = 0; i < d; ++i) centre[i] = dice.Uniform(-1, 1);
  c.shape = HollowBall((1 - radius - gap) * centre.normalized(), radius, one_wall);
}

void Voids(Case& c, Dice& dice) { VoidOf(c, dice, false); }
void Sheets(Case& c, Dice& dice) { VoidOf(c, dice, true); }

// Anything, at 0.05 to 1.5 of its reach.
void Anything(Case& c, Dice& dice) {
  const auto radial = [&](bool even) {
    std::vector<double> r{1};
    for (int j = 1; j <= 5; ++j)
      r.push_back(even && j % 2 ? 0 : dice.Uniform(-0.35, 0.35) / (1 + 0.5 * j));
    return r;
  };
  const auto space_curve = [&](int d) {
    MatrixXd cosines = MatrixXd::Zero(d, 4), sines = cosines;
    for (int j = 1; j < 4; ++j) {
      for (int i = 0; i < d; ++i) {
        cosines(i, j) = dice.Uniform(-1, 1) / (j * j);
        sines(i, j) = dice.Uniform(-1, 1) / (j * j);
      }
    }
    return Curve(cosines, sines);
  };
  switch (dice.Int(0, 7)) {
    case 0:
      c.shape = Curves({StarShaped(0, 0, radial(false))});
      break;
    case 1:
      c.shape = Curves({space_curve(dice.Int(3, 5))});
      break;
    case 2:
      c.shape = Revolution({StarShaped(0, 0, radial(true))}, true, dice.Int(1, 2));
      break;
    case 3:
      c.shape = Revolution({StarShaped(2.4, 0, radial(false))}, false, 1);
      break;
    case 4:
      c.shape = Product(Curves({StarShaped(0, 0, radial(false))}), Curves({Circle(0, 0, 0.6)}));
      break;
    case 5:
      c.shape = Product(Curves({space_curve(3)}), Curves({Circle(0, 0, 0.4)}));
      break;
    case 6: {
      MatrixXd centres = MatrixXd::Zero(3, 2);
      centres(0, 1) = dice.Uniform(2.3, 4);
      c.shape = Spheres(2, centres, {1, dice.Uniform(0.4, 1)});
      break;
    }
    default:
      c.shape = Product(Product(Curves({Circle(0, 0, 1)}), Curves({Circle(0, 0, 1)})),
                        Curves({Circle(0, 0, dice.Uniform(0.8, 1))}));
  }
  const int k = c.shape->k();
  double least = 0.05;  // so that some thousands of vertices do
  const double cost[] = {0, 1000, 30, 6};
  least = std::max(least, c.shape->Radius() / c.shape->Reach() / cost[k]);
  c.epsilon = c.shape->Reach() * dice.LogUniform(std::min(least, 1.2), 1.5);
}

const std::map<std::string, Maker>& Makers() {
  static const std::map<std::string, Maker> makers = {
      {"nested-spheres", NestedSpheres},
      {"neighbouring-spheres", NeighbouringSpheres},
      {"scattered-spheres", ScatteredSpheres},
      {"bubble", Bubble},
      {"knots", Knots},
      {"links", Links},
      {"nested-tori", NestedTori},
      {"peanuts", Peanuts},
      {"rings", Rings},
      {"pancakes", Pancakes},
      {"ripples", Ripples},
      {"products", Products},
      {"knot-times-circle", CloseKnotTimesCircle},
      {"wires", Wires},
      {"shells", Shells},
      {"holes", Holes},
      {"voids", Voids},
      {"sheets", Sheets},
      {"anything", Anything},
  };
  return makers;
}

}  // namespace

const std::vector<std::string>& Families() {
  static const std::vector<std::string> families = [] {
    std::vector<std::string> names;
    for (const auto& [name, maker] : Makers())
      if (name != "anything") names.push_back(name);
    names.push_back("anything");
    return names;
  }();
  return families;
}

Case MakeCase(const std::string& family, std::uint64_t seed, std::uint64_t n) {
  std::uint64_t name = 0;
  for (const char letter : family) name = name * 31 + static_cast<unsigned char>(letter);
  Dice dice(seed * 1'000'003 + name % 1'000'003, n);
  Case c;
  c.family = family;
  c.tangents = dice.Coin();
  c.seeds = dice.Coin();
  Makers().at(family)(c, dice);
  const bool places = !c.shape->Betti().empty() && !c.shape->curves() && c.shape->walls() == 0;
  if (places && dice.Int(0, 2) == 0)
    c.shape = Placed(c.shape, c.shape->d() + dice.Int(0, 2), dice.engine);
  return c;
}

bool IsBeyondSeeing(const std::string& family) { return family == "holes"; }

}  // namespace stellate::truth
