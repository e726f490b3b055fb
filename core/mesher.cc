#include "core/mesher.h"

#include "core/base/instantiate.h"
#include "core/run/meshing_run.h"

namespace stellate::core {

Expected<std::unique_ptr<Mesher>> Mesher::Create(Specification spec, Execution execution) {
  return CreatePart(std::move(spec), NoPeers(), execution);
}

Expected<std::unique_ptr<Mesher>> Mesher::CreatePart(Specification spec, const Peers& peers,
                                                     Execution execution) {
  if (Status status = Validate(spec); !status.ok()) return tl::unexpected<Status>(status);
  if (Status status = Validate(execution); !status.ok()) return tl::unexpected<Status>(status);
  return WithMeshDimension(spec.dimension, [&](auto k) -> std::unique_ptr<Mesher> {
    return std::make_unique<MeshingRun<k()>>(std::move(spec), peers, execution);
  });
}

}  // namespace stellate::core
