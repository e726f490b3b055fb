#include "core/mesher.h"

#include "core/run/meshing_run.h"

namespace stellate::core {

Expected<std::unique_ptr<Mesher>> Mesher::Create(Specification spec) {
  return CreatePart(std::move(spec), NoPeers());
}

Expected<std::unique_ptr<Mesher>> Mesher::CreatePart(Specification spec, const Peers& peers) {
  if (Status status = Validate(spec); !status.ok()) return tl::unexpected<Status>(status);
  switch (spec.dimension) {
    case 1:
      return std::make_unique<MeshingRun<1>>(std::move(spec), peers);
    case 2:
      return std::make_unique<MeshingRun<2>>(std::move(spec), peers);
    case 3:
      return std::make_unique<MeshingRun<3>>(std::move(spec), peers);
    case 4:
      return std::make_unique<MeshingRun<4>>(std::move(spec), peers);
    case 5:
      return std::make_unique<MeshingRun<5>>(std::move(spec), peers);
  }
  return Refuse(StatusCode::kLimitExceeded, "this build has no template for this dimension",
                "dimension");
}

}  // namespace stellate::core
