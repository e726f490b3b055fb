#include "core/mesher.h"

#include "core/base/instantiate.h"
#include "core/run/meshing_run.h"

namespace stellate::core {

Expected<std::unique_ptr<Mesher>> Mesher::Create(Specification spec) {
  return CreatePart(std::move(spec), NoPeers());
}

Expected<std::unique_ptr<Mesher>> Mesher::CreatePart(Specification spec, const Peers& peers) {
  if (Status status = Validate(spec); !status.ok()) return tl::unexpected<Status>(status);
  return WithMeshDimension(spec.dimension, [&](auto k) -> std::unique_ptr<Mesher> {
    return std::make_unique<MeshingRun<k()>>(std::move(spec), peers);
  });
}

}  // namespace stellate::core
