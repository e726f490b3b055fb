// Meshes one manifold with one mesher, once, and prints what it took as one line of JSON:
//
//   peers PROGRAM MANIFOLD SIZE [--ambient D] [--time-limit SECONDS] [--radius-edge RHO0]
//         [--estimate-tangents] [--clip OFFSET] [--no-quality]
//
// tests/bench/peers/compare.py starts one such process a measurement, so that none inherits
// another's memory.

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/bench/peers/peer.h"
#include "tests/bench/peers/quality.h"
#include "tests/support/make_manifold.h"

namespace stellate::bench {
namespace {

const std::map<std::string, Mesh> kPrograms = {
    {"stellate", MeshWithStellate},
    {"cgal-surface", MeshWithCgalSurface},
    {"gudhi-tangential", MeshWithGudhiTangential},
    {"gudhi-coxeter", MeshWithGudhiCoxeter},
};

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return quoted + "\"";
}

double Number(const std::string& text) {
  std::size_t used = 0;
  const double value = std::stod(text, &used);
  if (used != text.size()) throw std::invalid_argument("'" + text + "' is not a number");
  return value;
}

int Main(int argc, char** argv) {
  if (argc < 4) throw std::invalid_argument("usage: peers PROGRAM MANIFOLD SIZE [OPTION...]");
  const auto program = kPrograms.find(argv[1]);
  if (program == kPrograms.end()) {
    std::string known;
    for (const auto& [name, mesh] : kPrograms) known += " " + name;
    throw std::invalid_argument("no program '" + std::string(argv[1]) + "'; there are" + known);
  }
  Task task;
  task.manifold = argv[2];
  task.size = Number(argv[3]);
  bool with_quality = true;
  for (int i = 4; i < argc; ++i) {
    const std::string option = argv[i];
    if (option == "--no-quality") {
      with_quality = false;
    } else if (option == "--estimate-tangents") {
      task.estimate_tangents = true;
    } else if (option == "--ambient" && i + 1 < argc) {
      task.ambient_dimension = static_cast<int>(Number(argv[++i]));
    } else if (option == "--clip" && i + 1 < argc) {
      task.clip = Number(argv[++i]);
    } else if (option == "--time-limit" && i + 1 < argc) {
      task.time_limit = Number(argv[++i]);
    } else if (option == "--radius-edge" && i + 1 < argc) {
      task.radius_edge_bound = Number(argv[++i]);
    } else {
      throw std::invalid_argument("no option '" + option + "', or no value for it");
    }
  }

  Meter meter;
  const Outcome outcome = program->second(task, meter);
  if (outcome.simplices.empty()) throw std::runtime_error("no simplices: " + outcome.note);
  const std::size_t corners = [&] {
    const auto manifold = testing::Make(task.manifold);
    return static_cast<std::size_t>(manifold->dimension()) + 1;
  }();
  std::printf(
      "{\"program\": %s, \"manifold\": %s, \"size\": %.17g, \"vertices\": %lld, "
      "\"simplices\": %zu, \"seconds\": %.6f, \"oracle_seconds\": %.6f, "
      "\"certificate_seconds\": %.6f, \"evaluations\": %llu, \"peak_bytes\": %lld, "
      "\"note\": %s",
      Quoted(program->first).c_str(), Quoted(task.manifold).c_str(), task.size,
      static_cast<long long>(outcome.points.cols()), outcome.simplices.size() / corners,
      meter.seconds(), outcome.oracle_seconds, outcome.certificate_seconds,
      static_cast<unsigned long long>(outcome.evaluations),
      static_cast<long long>(meter.peak_bytes()), Quoted(outcome.note).c_str());
  if (with_quality) {
    const auto manifold = testing::Make(task.manifold);
    const Quality quality = MeasureQuality(*manifold, outcome.points, outcome.simplices, task.clip);
    std::printf(
        ", \"hausdorff\": %.6g, \"min_angle_degrees\": %.6g, \"min_fatness\": %.6g, "
        "\"euler_characteristic\": %lld, \"closed\": %s",
        quality.hausdorff, quality.min_angle_degrees, quality.min_fatness,
        static_cast<long long>(quality.euler_characteristic), quality.closed ? "true" : "false");
  }
  std::puts("}");
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace stellate::bench

int main(int argc, char** argv) {
  try {
    return stellate::bench::Main(argc, argv);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "peers: %s\n", failure.what());
    return EXIT_FAILURE;
  }
}
