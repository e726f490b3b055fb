// Manifolds with boundary that have names.
#include <Eigen/Core>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "oracles/combined/common.h"
#include "stellate/catalogue.h"
#include "stellate/implicit.h"
#include "stellate/oracles/walls.h"

namespace stellate::oracles {
namespace {

using Eigen::MatrixXd, Eigen::VectorXd;
using Numbers = std::vector<double>;

constexpr int kMaxDimension = 7;
constexpr double kRoom = 0.3;  // of the boxes around solids

struct Domain {
  CatalogueEntry entry;
  Numbers defaults;  // of its parameters
  std::unique_ptr<Oracle> (*make)(const Numbers& parameters);
};

std::shared_ptr<Oracle> Known(const std::string& spec) {
  Expected<std::unique_ptr<Manifold>> manifold = MakeManifold(spec);
  if (!manifold) Refuse(manifold.error().message);
  return std::move(*manifold);
}

// A dimension among the parameters.
int Dimension(double value, int least) {
  if (value != std::floor(value) || value < least || value > kMaxDimension) {
    Refuse("the dimension has to be a whole number from " + std::to_string(least) + " to " +
           std::to_string(kMaxDimension));
  }
  return static_cast<int>(value);
}

BoundingBox Around(const VectorXd& half) {
  return {-(half.array() + kRoom).matrix(), (half.array() + kRoom).matrix()};
}

std::unique_ptr<Oracle> Solids(std::vector<Wall> walls, const VectorXd& half) {
  return std::make_unique<Solid>(std::move(walls), Around(half));
}

std::unique_ptr<Oracle> ClippedBy(const std::shared_ptr<Oracle>& oracle, std::vector<Wall> walls) {
  return std::make_unique<Clipped>(oracle, std::move(walls));
}

std::unique_ptr<Oracle> Hemisphere(const Numbers& p) {
  const int k = Dimension(p[0], 1);
  return ClippedBy(Known("sphere:" + std::to_string(k)), {HalfSpace(VectorXd::Unit(k + 1, k))});
}

std::unique_ptr<Oracle> HalfTorus(const Numbers& p) {
  return ClippedBy(Known("torus:" + Short(p[0]) + ":" + Short(p[1])),
                   {HalfSpace(VectorXd::Unit(3, 0))});
}

// The projective plane without a disc.
std::unique_ptr<Oracle> Moebius(const Numbers& /*p*/) {
  return ClippedBy(Known("rp2:6"), {HalfSpace(-VectorXd::Unit(6, 0), -0.6)});
}

// Off its planes of symmetry, where walls could meet it tangentially.
std::unique_ptr<Oracle> GyroidBox(const Numbers& p) {
  if (!(p[0] > 0)) Refuse("the box needs a positive half side");
  const VectorXd centre = (VectorXd(3) << 0.1, 0.2, 0.3).finished();
  const VectorXd half = VectorXd::Constant(3, p[0]), room = VectorXd::Constant(3, p[0] + 1);
  const auto f = [](const VectorXd& x) {
    return VectorXd::Constant(1, std::sin(x[0]) * std::cos(x[1]) + std::sin(x[1]) * std::cos(x[2]) +
                                     std::sin(x[2]) * std::cos(x[0]));
  };
  const auto slope = [](const VectorXd& x) {
    MatrixXd row(1, 3);
    for (int i = 0; i < 3; ++i) {
      const int next = (i + 1) % 3, last = (i + 2) % 3;
      row(0, i) = std::cos(x[i]) * std::cos(x[next]) - std::sin(x[last]) * std::sin(x[i]);
    }
    return row;
  };
  const BoundingBox box{centre - room, centre + room};
  return ClippedBy(std::make_shared<ImplicitOracle>(2, 3, f, slope, box),
                   Box(centre - half, centre + half));
}

std::unique_ptr<Oracle> SolidBall(const Numbers& p) {
  const int k = Dimension(p[0], 2);
  return Solids({Ball(VectorXd::Zero(k), 1)}, VectorXd::Ones(k));
}

std::unique_ptr<Oracle> Cube(const Numbers& p) {
  const int k = Dimension(p[0], 2);
  return Solids(Box(-VectorXd::Ones(k), VectorXd::Ones(k)), VectorXd::Ones(k));
}

// Outside of a cylinder about the z axis, or inside: sign -1.
Wall Tube(double radius, double sign) {
  return {[=](const VectorXd& x) { return sign * (x.head(2).squaredNorm() - radius * radius); },
          [=](const VectorXd& x) -> VectorXd {
            return 2 * sign * (VectorXd(3) << x[0], x[1], 0).finished();
          }};
}

std::vector<Wall> Slab() {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const VectorXd upper = (VectorXd(3) << kNone, kNone, 1).finished();
  return Box(-upper, upper);
}

std::unique_ptr<Oracle> Cylinder(const Numbers& /*p*/) {
  std::vector<Wall> walls = Slab();
  walls.push_back(Tube(1, -1));
  return Solids(std::move(walls), VectorXd::Ones(3));
}

std::unique_ptr<Oracle> DrilledCube(const Numbers& p) {
  if (!(p[0] > 0) || !(p[0] < 1)) Refuse("the hole's radius has to be between 0 and 1");
  std::vector<Wall> walls = Box(-VectorXd::Ones(3), VectorXd::Ones(3));
  walls.push_back(Tube(p[0], 1));
  return Solids(std::move(walls), VectorXd::Ones(3));
}

std::unique_ptr<Oracle> Shell(const Numbers& p) {
  if (!(p[0] > 0) || !(p[0] < 1)) Refuse("the inner radius has to be between 0 and 1");
  const double inner = p[0];
  const Wall hole{[inner](const VectorXd& x) { return x.squaredNorm() - inner * inner; },
                  [](const VectorXd& x) -> VectorXd { return 2 * x; }};
  return Solids({Ball(VectorXd::Zero(3), 1), hole}, VectorXd::Ones(3));
}

std::unique_ptr<Oracle> SolidTorus(const Numbers& p) {
  const double R = p[0], r = p[1];
  if (!(r > 0) || !(R > r)) Refuse("a torus needs R > r > 0");
  const Wall wall{[=](const VectorXd& x) {
                    const double off = x.head(2).norm() - R;
                    return r * r - off * off - x[2] * x[2];
                  },
                  {}};
  return Solids({wall}, (VectorXd(3) << R + r, R + r, r).finished());
}

const std::vector<Domain>& Domains() {
  static const std::vector<Domain> domains = {
      {{"hemisphere[:k]", "hemisphere:2", "upper half of the unit k-sphere"}, {2}, Hemisphere},
      {{"half-torus[:R:r]", "half-torus:1:0.4", "torus of revolution, where x >= 0"},
       {1, 0.4},
       HalfTorus},
      {{"moebius", "moebius", "Moebius strip: rp2:6 without a disc"}, {}, Moebius},
      {{"gyroid-box[:a]", "gyroid-box:2.6", "gyroid in a box of half side a"}, {2.6}, GyroidBox},
      {{"ball[:k]", "ball:3", "unit ball of R^k"}, {3}, SolidBall},
      {{"cube[:k]", "cube:3", "cube of R^k from -1 to 1"}, {3}, Cube},
      {{"cylinder", "cylinder", "solid cylinder of radius 1 from z = -1 to 1"}, {}, Cylinder},
      {{"drilled-cube[:r]", "drilled-cube:0.5", "cube with a cylindrical hole of radius r"},
       {0.5},
       DrilledCube},
      {{"shell[:r]", "shell:0.4", "unit ball of R^3 without one of radius r"}, {0.4}, Shell},
      {{"solid-torus[:R:r]", "solid-torus:1:0.4", "what a torus encloses"}, {1, 0.4}, SolidTorus},
  };
  return domains;
}

// What stands after the name, and the defaults after that.
Numbers Parameters(const std::string& spec, size_t colon, Numbers defaults) {
  size_t count = 0;
  while (colon != std::string::npos) {
    const size_t next = spec.find(':', colon + 1);
    const std::string text = spec.substr(colon + 1, next - colon - 1);
    if (count == defaults.size()) {
      Refuse("it takes at most " + std::to_string(count) + " parameters");
    }
    double& value = defaults[count++];
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
      Refuse("'" + text + "' is not a number");
    }
    colon = next;
  }
  return defaults;
}

}  // namespace

Expected<std::unique_ptr<Oracle>> MakeDomain(const std::string& spec) {
  const size_t colon = spec.find(':');
  const std::string name = spec.substr(0, colon);
  for (const Domain& domain : Domains()) {
    const std::string& syntax = domain.entry.syntax;
    if (syntax.substr(0, syntax.find('[')) != name) continue;
    try {
      return domain.make(Parameters(spec, colon, domain.defaults));
    } catch (const std::invalid_argument& failure) {
      return Fail(ErrorCode::kRefused, "manifold '" + spec + "': " + failure.what());
    }
  }
  return Fail(ErrorCode::kRefused, "manifold '" + spec + "': there is none of that name",
              "UNKNOWN_NAME");
}

const std::vector<CatalogueEntry>& ListDomains() {
  static const std::vector<CatalogueEntry> entries = [] {
    std::vector<CatalogueEntry> all;
    for (const Domain& domain : Domains()) all.push_back(domain.entry);
    return all;
  }();
  return entries;
}

}  // namespace stellate::oracles
