#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/boundary/boundary_mesh.h"
#include "core/refinement/engine.h"
#include "core/report.h"

namespace stellate::core {

// The mesh that a run hands out: the engine's, or, if the inside is left, that of the boundary.
template <int K>
class OutputMesh {
 public:
  // `engine` is borrowed.
  explicit OutputMesh(const Engine<K>& engine);

  // Call it when a round is absorbed: takes the boundary as it is now, if that is the mesh, and
  // adds its change to the round's delta.
  void Update(MeshDelta* delta);
  // Adds the vertices from delta->first_vertex on, and the engine's change in simplices, if those
  // are the mesh.
  void Add(typename Engine<K>::Change change, MeshDelta* delta) const;

  std::uint64_t size() const { return boundary_ ? boundary_->size() : engine_.simplex_count(); }
  Eigen::Map<const Eigen::MatrixXd> Points() const;  // d x n
  // As of Mesher.
  std::vector<std::uint32_t> Simplices() const;
  std::vector<std::int8_t> Labels() const;

 private:
  const Engine<K>& engine_;
  std::optional<BoundaryMesh<K>> boundary_;
};

STELLATE_DECLARE_CLASS(OutputMesh)

}  // namespace stellate::core
