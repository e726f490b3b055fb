#include "core/run/output_mesh.h"

#include <utility>

#include "core/complex/labels.h"

namespace stellate::core {

template <int K>
OutputMesh<K>::OutputMesh(const Engine<K>& engine) : engine_(engine) {
  if (engine.boundary().policy().LeavesInside()) boundary_.emplace();
}

template <int K>
void OutputMesh<K>::Update(MeshDelta* delta) {
  if (boundary_) boundary_->Update(engine_.stars(), delta);
}

template <int K>
void OutputMesh<K>::Add(typename Engine<K>::Change change, MeshDelta* delta) const {
  const Stars<K>& stars = engine_.stars();
  delta->points = Points().rightCols(stars.size() - static_cast<Eigen::Index>(delta->first_vertex));
  if (engine_.boundary().policy().TakesClearances())
    for (auto v = static_cast<std::uint32_t>(delta->first_vertex); v < stars.size(); ++v)
      delta->walls.push_back(stars.sample().walls(v));
  if (boundary_) return;
  delta->added = std::move(change.added);
  delta->removed = std::move(change.removed);
  delta->labels = LabelsOf(stars, delta->added);
}

template <int K>
Eigen::Map<const Eigen::MatrixXd> OutputMesh<K>::Points() const {
  const Sample<K>& sample = engine_.stars().sample();
  return {sample.points().data(), sample.d(), engine_.stars().size()};
}

template <int K>
std::vector<std::uint32_t> OutputMesh<K>::Simplices() const {
  return boundary_ ? boundary_->Simplices() : engine_.Simplices();
}

template <int K>
std::vector<std::int8_t> OutputMesh<K>::Labels() const {
  return boundary_ ? boundary_->Labels() : LabelsOf(engine_.stars(), engine_.Simplices());
}

STELLATE_INSTANTIATE_CLASS(OutputMesh)

}  // namespace stellate::core
