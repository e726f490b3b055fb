#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/certificate/certifier.h"
#include "core/refinement/engine.h"

namespace stellate::core {

// Collects facts from the stars of a mesh that satisfies every rule. `engine` estimates its sizes
// meanwhile.
template <int K>
StarFacts FactsOf(Engine<K>& engine);

// The part of MeshView about the boundary.
struct BoundaryOfMesh {
  std::vector<WallSet> walls;       // by vertex
  std::vector<double> outward;      // k tangent coordinates by vertex
  std::vector<std::int8_t> labels;  // of arrangements: by simplex; and by vertex, as of MeshView
  std::vector<WallSet> signs;
  std::vector<std::uint8_t> one_sided;
  std::map<std::uint32_t, std::vector<WallSet>> corner_sectors;
  const LabelTable* table = nullptr;  // borrowed
  std::vector<FaceMesh> faces;
  std::vector<double> balls;  // squared radii of protecting balls, by vertex; empty: none
};
// Nothing of a manifold without boundary.
template <int K>
std::optional<BoundaryOfMesh> BoundaryOf(const Engine<K>& engine);

// Owns the certifier of a run's mesh, with the simplices and the boundary that it reads.
class Certification {
 public:
  // spec      borrowed
  // mesh      its points and tangents are borrowed and must not change; its simplices are set here
  // known     what the run knows of M
  // boundary  of a manifold with boundary
  Certification(const Specification& spec, MeshView mesh, std::vector<std::uint32_t> simplices,
                const StarFacts& facts, KnownOfManifold known,
                std::optional<BoundaryOfMesh> boundary = std::nullopt);

  Certifier& certifier() const { return *certifier_; }

 private:
  std::vector<std::uint32_t> simplices_;
  std::optional<BoundaryOfMesh> boundary_;
  std::unique_ptr<Certifier> certifier_;
};

}  // namespace stellate::core
