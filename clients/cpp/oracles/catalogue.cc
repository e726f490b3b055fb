#include "stellate/catalogue.h"

#include <Eigen/QR>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>
#include <utility>

#include "shapes/shapes.h"

namespace stellate {
namespace {

constexpr int kMaxAmbientDimension = 4096;  // what servers take at most
constexpr int kMaxProduct = 16;             // factors of a product, axes of an ellipsoid

struct Parsed {
  std::string name;
  std::vector<double> parameters;
  int turned_into = 0;  // the d of "@d", or 0
};

[[noreturn]] void Fail(const std::string& why) { throw std::invalid_argument(why); }

double Number(const std::string& text) {
  double value = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    Fail("'" + text + "' is not a number");
  }
  return value;
}

int Integer(double value, const char* what, int low, int high) {
  if (value != std::floor(value) || value < low || value > high) {
    Fail(std::string(what) + " must be a whole number from " + std::to_string(low) + " to " +
         std::to_string(high));
  }
  return static_cast<int>(value);
}

Parsed Parse(const std::string& spec) {
  Parsed parsed;
  std::string rest = spec;
  if (const size_t at = rest.find('@'); at != std::string::npos) {
    parsed.turned_into =
        Integer(Number(rest.substr(at + 1)), "the dimension after @", 2, kMaxAmbientDimension);
    rest.resize(at);
  }
  size_t colon = rest.find(':');
  parsed.name = rest.substr(0, colon);
  while (colon != std::string::npos) {
    const size_t next = rest.find(':', colon + 1);
    parsed.parameters.push_back(Number(rest.substr(colon + 1, next - colon - 1)));
    colon = next;
  }
  return parsed;
}

double Parameter(const Parsed& parsed, size_t i, double otherwise) {
  return i < parsed.parameters.size() ? parsed.parameters[i] : otherwise;
}

void AtMost(const Parsed& parsed, size_t count) {
  if (parsed.parameters.size() > count) {
    Fail(parsed.name + " takes at most " + std::to_string(count) + " parameters");
  }
}

std::vector<double> Lengths(std::vector<double> values, const char* what, size_t least) {
  if (values.size() < least || values.size() > kMaxProduct) {
    Fail(std::string("needs ") + std::to_string(least) + " to " + std::to_string(kMaxProduct) +
         " " + what);
  }
  for (const double value : values) {
    if (!(value > 0)) Fail(std::string(what) + " must be positive");
  }
  return values;
}

std::vector<int> SphereBetti(int k) {
  std::vector<int> betti(static_cast<size_t>(k) + 1, 0);
  betti.front() = betti.back() = 1;
  return betti;
}

std::vector<int> TorusBetti(int k) {
  std::vector<int> betti = {1};
  for (int i = 1; i <= k; ++i) betti.push_back(betti.back() * (k - i + 1) / i);
  return betti;
}

struct Built {
  std::unique_ptr<PointwiseOracle> shape;
  std::string description;
  std::vector<int> betti_mod2, betti_mod3;
  std::optional<double> reach;
  bool orientable = true;
  int turned_into = 0;  // asked for by a parameter rather than by @d
};

Built Same(std::unique_ptr<PointwiseOracle> shape, std::string description, std::vector<int> betti,
           std::optional<double> reach) {
  return {std::move(shape), std::move(description), betti, std::move(betti), reach};
}

Built BuildSphere(int k, int d) {
  Built built = Same(shapes::Sphere(k), "unit sphere", SphereBetti(k), 1.0);
  if (d > k + 1) built.turned_into = d;
  return built;
}

Built BuildEllipsoid(const Parsed& parsed) {
  const std::vector<double> axes =
      Lengths(parsed.parameters.empty() ? std::vector<double>{1, 0.8, 0.6} : parsed.parameters,
              "semi-axes", 2);
  const auto [low, high] = std::minmax_element(axes.begin(), axes.end());
  const int k = static_cast<int>(axes.size()) - 1;
  return Same(shapes::Ellipsoid(axes), "ellipsoid with the given semi-axes", SphereBetti(k),
              *low * *low / *high);
}

Built BuildCircles(const std::vector<double>& radii, std::string description) {
  return Same(shapes::Circles(radii), std::move(description),
              TorusBetti(static_cast<int>(radii.size())),
              *std::min_element(radii.begin(), radii.end()));
}

Built Build(const Parsed& p) {
  if (p.name == "circle") {
    AtMost(p, 1);
    return BuildSphere(1, Integer(Parameter(p, 0, 2), "d", 2, kMaxAmbientDimension));
  }
  if (p.name == "sphere") {
    AtMost(p, 2);
    const int k = Integer(Parameter(p, 0, 2), "k", 1, kMaxProduct);
    return BuildSphere(k, Integer(Parameter(p, 1, k + 1), "d", k + 1, kMaxAmbientDimension));
  }
  if (p.name == "two-spheres") {
    AtMost(p, 0);
    return Same(shapes::TwoSpheres(), "two unit spheres, a unit apart", {2, 0, 2}, 0.5);
  }
  if (p.name == "torus-knot") {
    AtMost(p, 2);
    const int turns = Integer(Parameter(p, 0, 2), "p", 1, 50);
    const int winds = Integer(Parameter(p, 1, 3), "q", 1, 50);
    if (std::gcd(turns, winds) != 1) Fail("p and q must be coprime, or the curve is a link");
    return Same(shapes::TorusKnot(turns, winds), "knot on a torus", {1, 1}, std::nullopt);
  }
  if (p.name == "ellipsoid") return BuildEllipsoid(p);
  if (p.name == "torus") {
    AtMost(p, 2);
    const double R = Parameter(p, 0, 1), r = Parameter(p, 1, 0.4);
    if (!(r > 0) || !(R > r)) Fail("a torus needs R > r > 0");
    return Same(shapes::Torus(R, r), "torus of revolution", {1, 2, 1}, std::min(r, R - r));
  }
  if (p.name == "tanglecube") {
    AtMost(p, 0);
    return Same(shapes::Tanglecube(), "quartic surface of genus 5", {1, 10, 1}, std::nullopt);
  }
  if (p.name == "clifford-torus") {
    AtMost(p, 0);
    return BuildCircles({std::sqrt(0.5), std::sqrt(0.5)}, "flat torus in the unit 3-sphere");
  }
  if (p.name == "flat-torus") {
    AtMost(p, 1);
    const int k = Integer(Parameter(p, 0, 3), "k", 1, kMaxProduct);
    return BuildCircles(std::vector<double>(static_cast<size_t>(k), 1.0),
                        "product of k unit circles");
  }
  if (p.name == "circles") {
    return BuildCircles(Lengths(p.parameters, "radii", 1), "product of circles");
  }
  if (p.name == "so3") {
    AtMost(p, 0);
    Built built = Same(shapes::Rotations3(), "rotations of space, as 3 x 3 matrices", {},
                       std::numbers::sqrt2);
    built.betti_mod2 = {1, 1, 1, 1};
    built.betti_mod3 = {1, 0, 0, 1};
    return built;
  }
  if (p.name == "rp2") {
    AtMost(p, 1);
    Built built = Same(shapes::ProjectivePlane(Integer(Parameter(p, 0, 6), "d", 5, 6)),
                       "projective plane (Veronese)", {}, std::sqrt(0.5));
    built.betti_mod2 = {1, 1, 1};
    built.betti_mod3 = {1, 0, 0};
    built.orientable = false;
    return built;
  }
  Fail("there is no manifold '" + p.name + "' in the catalogue");
}

// Orthonormal columns that depend on the sizes alone.
Eigen::MatrixXd Frame(int d, int inner) {
  // The engine's output is fixed by the standard, the distributions' is not.
  std::mt19937_64 random(static_cast<std::uint64_t>(d) * 1'000'003 +
                         static_cast<std::uint64_t>(inner));
  Eigen::MatrixXd entries(d, inner);
  for (Eigen::Index i = 0; i < entries.size(); ++i) {
    entries.data()[i] = std::ldexp(static_cast<double>(random() >> 11), -52) - 1;
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(entries);
  return qr.householderQ() * Eigen::MatrixXd::Identity(d, inner);
}

}  // namespace

Expected<std::unique_ptr<Manifold>> MakeManifold(const std::string& spec) {
  try {
    const Parsed parsed = Parse(spec);
    Built built = Build(parsed);
    const int inner = built.shape->ambient_dimension();
    const int d = std::max({parsed.turned_into, built.turned_into, inner});
    if (parsed.turned_into != 0 && parsed.turned_into != d) {
      Fail("it does not fit into dimension " + std::to_string(parsed.turned_into));
    }
    ManifoldFacts facts;
    facts.spec = spec;
    facts.description = built.description;
    facts.dimension = built.shape->dimension();
    facts.ambient_dimension = d;
    facts.betti_mod2 = built.betti_mod2;
    facts.betti_mod3 = built.betti_mod3;
    facts.orientable = built.orientable;
    facts.reach = built.reach;
    for (size_t i = 0; i < facts.betti_mod2.size(); ++i) {
      facts.euler_characteristic += (i % 2 == 0 ? 1 : -1) * facts.betti_mod2[i];
    }
    const bool turned = parsed.turned_into != 0 || built.turned_into != 0;
    Eigen::MatrixXd frame;
    if (turned) frame = Frame(d, inner);
    return std::make_unique<Manifold>(std::move(built.shape), std::move(facts), std::move(frame));
  } catch (const std::invalid_argument& failure) {
    return stellate::Fail(ErrorCode::kRefused, "manifold '" + spec + "': " + failure.what());
  }
}

const std::vector<CatalogueEntry>& ListManifolds() {
  static const std::vector<CatalogueEntry> entries = {
      {"circle[:d]", "circle:10", "unit circle in R^d"},
      {"torus-knot[:p:q]", "torus-knot:2:3", "knot on a torus in R^3, p times round, q times over"},
      {"sphere[:k[:d]]", "sphere:2:3", "unit k-sphere in R^d"},
      {"two-spheres", "two-spheres", "two unit spheres of R^3, a unit apart"},
      {"ellipsoid[:a:b:c...]", "ellipsoid:1:0.8:0.6", "ellipsoid in R^m with m semi-axes"},
      {"torus[:R:r]", "torus:1:0.4", "torus of revolution in R^3"},
      {"tanglecube", "tanglecube", "quartic surface of genus 5 in R^3"},
      {"clifford-torus", "clifford-torus", "flat torus in the unit 3-sphere of R^4"},
      {"flat-torus[:k]", "flat-torus:3", "product of k unit circles in R^2k"},
      {"circles:r1:r2...", "circles:1:0.5", "product of circles of the given radii"},
      {"so3", "so3", "rotation matrices in R^9, Frobenius metric"},
      {"rp2[:d]", "rp2:5", "projective plane (Veronese) in R^5 or R^6"},
      {"NAME@d", "torus:1:0.4@20", "any of these, turned into R^d"},
  };
  return entries;
}

}  // namespace stellate
