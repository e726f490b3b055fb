#include "oracle_source.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "stellate/catalogue.h"
#include "stellate/oracles/combined.h"
#include "stellate/oracles/walls.h"
#include "stellate/solids.h"

namespace stellate::cli {

namespace {

constexpr const char* kClips =
    "box:LOWER:UPPER, ball:CENTRE:RADIUS or half-space:NORMAL:OFFSET, where points are numbers "
    "between commas";

Expected<Eigen::MatrixXd> OnePoint(std::string_view text) {
  Expected<Eigen::MatrixXd> points = ParsePoints(text);
  if (points && points->cols() != 1) return Fail(ErrorCode::kRefused, "more than one point");
  return points;
}

// The walls of one --clip, of a manifold in R^d.
Expected<std::vector<oracles::Wall>> ParseClip(const std::string& text, int d) {
  const auto refuse = [&](const std::string& why) {
    return Fail(ErrorCode::kRefused, "--clip " + text + ": " + why);
  };
  const size_t first = text.find(':'), last = text.rfind(':');
  if (first == last) return refuse(std::string("has to be ") + kClips);
  const std::string kind = text.substr(0, first);
  const auto left = OnePoint(std::string_view(text).substr(first + 1, last - first - 1));
  const auto right = OnePoint(std::string_view(text).substr(last + 1));
  for (const auto* const end : {&left, &right}) {
    if (!*end) return refuse(end->error().message);
  }
  const bool box = kind == "box";
  if (left->rows() != d || right->rows() != (box ? d : 1)) {
    return refuse("the manifold lies in R^" + std::to_string(d));
  }
  try {
    if (box) return oracles::Box(left->col(0), right->col(0));
    if (kind == "ball") return std::vector{oracles::Ball(left->col(0), (*right)(0, 0))};
    if (kind == "half-space") {
      return std::vector{oracles::HalfSpace(left->col(0), (*right)(0, 0))};
    }
  } catch (const std::invalid_argument& failure) {
    return refuse(failure.what());
  }
  return refuse(std::string("has to be ") + kClips);
}

Expected<std::unique_ptr<Oracle>> Clip(std::unique_ptr<Oracle> oracle,
                                       const std::vector<std::string>& clips) {
  if (clips.empty()) return oracle;
  std::vector<oracles::Wall> walls;
  for (const std::string& clip : clips) {
    const auto more = ParseClip(clip, oracle->ambient_dimension());
    if (!more) return tl::unexpected(more.error());
    walls.insert(walls.end(), more->begin(), more->end());
  }
  try {
    return std::make_unique<oracles::Clipped>(std::move(oracle), std::move(walls));
  } catch (const std::invalid_argument& failure) {
    return Fail(ErrorCode::kRefused, std::string("--clip: ") + failure.what());
  }
}

tl::unexpected<Error> NoSuch(const std::string& why) {
  return Fail(ErrorCode::kRefused, why + "; 'stellate list' shows what there is");
}

constexpr const char* kSolids =
    "ball(radius, at=), box(lower, upper), cylinder(axis, radius, height, at=), cone, torus, "
    "capsule, halfspace and blend, joined by & | - ^ ~, moved by .at(x, y, z), .rotated(axis, "
    "degrees), .scaled(factor), .offset(distance): docs/using/solids.md";

Expected<solids::Solid> Parse(const std::string& option, const std::string& expression) {
  Expected<solids::Solid> solid = solids::ParseSolid(expression);
  if (!solid) return Fail(ErrorCode::kRefused, option + ": " + solid.error().message);
  return solid;
}

// Throws std::invalid_argument for materials that cannot be meshed together.
Expected<std::unique_ptr<Oracle>> ParseMaterials(const std::vector<std::string>& given) {
  std::vector<std::pair<std::string, solids::Solid>> materials;
  for (const std::string& material : given) {
    const size_t equals = material.find('=');
    const std::string name = material.substr(0, equals);
    const bool plain = name.find_first_not_of(
                           "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                           "0123456789_-") == std::string::npos;
    if (equals == std::string::npos || name.empty() || !plain) {
      return Fail(ErrorCode::kRefused,
                  "--material " + material +
                      ": has to be NAME=SOLID, the name of letters, digits, _ and -");
    }
    Expected<solids::Solid> solid = Parse("--material " + name, material.substr(equals + 1));
    if (!solid) return tl::unexpected(solid.error());
    materials.emplace_back(name, std::move(*solid));
  }
  return std::make_unique<solids::Labels>(std::move(materials));
}

Expected<std::unique_ptr<Oracle>> ParseSolid(const std::string& expression) {
  Expected<solids::Solid> solid = Parse("--solid", expression);
  if (!solid) return tl::unexpected(solid.error());
  return std::make_unique<solids::Solid>(std::move(*solid));
}

}  // namespace

OracleSource::OracleSource(CLI::App* command) {
  CLI::Option* const manifold = command->add_option(
      "manifold", manifold_,
      "e.g. torus:1:0.4; see 'stellate list'. Or, instead of it, a solid or a command");
  CLI::Option* const solid =
      command
          ->add_option("--solid", solid_,
                       std::string("a solid in words, e.g. \"box(-1, 1) & ball(1.3) - cylinder(x, "
                                   "0.5)\": ") +
                           kSolids)
          ->type_name("SOLID")
          ->excludes(manifold);
  CLI::Option* const material =
      command
          ->add_option(
              "--material", materials_,
              "several materials, once for each, as --material \"grain=ball(0.6)\": regions "
              "1, 2, ... of the mesh; where they overlap the later one wins")
          ->type_name("NAME=SOLID")
          ->allow_extra_args(false)
          ->excludes(manifold)
          ->excludes(solid);
  command
      ->add_option("--clip", clips_,
                   "what is left of it inside a wall, with a boundary there; may be given again. " +
                       std::string(kClips) + ", as --clip=half-space:0,0,1:0.2")
      ->type_name("WALL")
      ->allow_extra_args(false)
      ->excludes(solid)
      ->excludes(material);
  command
      ->add_option("--scale", scale_,
                   "where axes have different units: how far the manifold goes along each, "
                   ".01,500,1; --epsilon and all other lengths are of x / scale, the mesh is in x: "
                   "docs/fields/scaling.md")
      ->type_name("S1,S2,...")
      ->delimiter(',');
  CLI::App* const group = command->add_option_group(
      "Oracle command",
      "a program in any language that answers batches of queries: docs/using/pipe.md");
  CLI::Option* const oracle = group->add_option("--oracle-command", command_.command,
                                                "for the shell, e.g. \"octave-cli -q torus.m\"");
  oracle->excludes(manifold)->excludes(solid)->excludes(material);
  const auto add = [&](const std::string& flags, auto& value, const std::string& help) {
    return group->add_option(flags, value, help)->needs(oracle);
  };
  add("--oracle-processes", command_.processes, "that answer, each a chunk at a time")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  add("-k,--dimension", command_.dimension, "of the manifold, unless the command says it");
  add("-d,--ambient-dimension", command_.ambient_dimension, "of space, unless the command says it");
  add("--box", box_, "where the manifold is: two corners, as --box=-1,-1,-1:1,1,1")
      ->type_name("LOWER:UPPER");
  add("--seeds", seeds_, "or points near it, one at least on each component, as --seeds=1,0,0")
      ->type_name("X,Y,...");
  add("--oracle-start", command_.start_seconds, "seconds that the command has for its first line")
      ->capture_default_str();
  add("--oracle-silence", command_.silence_seconds,
      "seconds that it may neither read nor write while it answers a batch")
      ->capture_default_str();
}

Expected<void> OracleSource::ReadWhereabouts() {
  if (!box_.empty()) {
    Expected<BoundingBox> box = ParseBox(box_);
    if (!box) return tl::unexpected(box.error());
    command_.box = std::move(*box);
  }
  std::string all;
  for (const std::string& seed : seeds_) all += (all.empty() ? "" : ";") + seed;
  if (all.empty()) return {};
  Expected<Eigen::MatrixXd> points = ParsePoints(all);
  if (!points) return tl::unexpected(points.error());
  command_.seeds = std::move(*points);
  return {};
}

Expected<std::unique_ptr<Oracle>> OracleSource::Make(std::stop_token stop, bool quiet) {
  auto made = MakeUnclipped(std::move(stop), quiet);
  if (made) made = Clip(std::move(*made), clips_);
  if (!made || scale_.empty()) return made;
  const auto axes = static_cast<Eigen::Index>(scale_.size());
  try {
    return std::make_unique<oracles::InUnits>(
        std::move(*made), Eigen::Map<const Eigen::VectorXd>(scale_.data(), axes));
  } catch (const std::invalid_argument& refusal) {
    return Fail(ErrorCode::kRefused, std::string("--scale: ") + refusal.what());
  }
}

std::string OracleSource::name() const {
  if (!command_.command.empty()) return command_.command;
  if (!solid_.empty()) return solid_;
  std::string all = manifold_;
  for (const std::string& material : materials_) all += (all.empty() ? "" : ", ") + material;
  return all;
}

// What is wrong with a solid is said before anything else is done with it.
Expected<std::unique_ptr<Oracle>> OracleSource::MakeSolid() const {
  try {
    auto made = materials_.empty() ? ParseSolid(solid_) : ParseMaterials(materials_);
    if (made) (*made)->walls();
    return made;
  } catch (const std::invalid_argument& refusal) {
    return Fail(ErrorCode::kRefused, refusal.what());
  }
}

Expected<std::unique_ptr<Oracle>> OracleSource::MakeUnclipped(std::stop_token stop, bool quiet) {
  if (!solid_.empty() || !materials_.empty()) return MakeSolid();
  if (command_.command.empty()) {
    if (manifold_.empty()) return NoSuch("name a manifold, or give --solid or --oracle-command");
    if (std::filesystem::is_regular_file(manifold_))
      return NoSuch("'" + manifold_ +
                    "' is a file: points in one are meshed by 'stellate reconstruct'");
    Expected<std::unique_ptr<Oracle>> domain = oracles::MakeDomain(manifold_);
    if (domain) return domain;
    if (domain.error().reason != "UNKNOWN_NAME") return NoSuch(domain.error().message);
    Expected<std::unique_ptr<Manifold>> manifold = MakeManifold(manifold_);
    if (!manifold) return NoSuch(manifold.error().message);
    return std::unique_ptr<Oracle>(std::move(*manifold));
  }
  if (const auto ok = ReadWhereabouts(); !ok) return tl::unexpected(ok.error());
  command_.stop = std::move(stop);
  command_.on_restart = [](const std::string& how) {
    std::fprintf(stderr, "stellate: %s\nstellate: it is started again\n", how.c_str());
  };
  if (!quiet) {
    command_.on_waiting = [](const std::string& what) {
      // Over a line of progress, which is drawn anew.
      const char* const over = isatty(STDERR_FILENO) == 1 ? "\r\033[K" : "";
      std::fprintf(stderr, "%sstellate: %s\n", over, what.c_str());
    };
  }
  return StartCommand(command_);
}

}  // namespace stellate::cli
