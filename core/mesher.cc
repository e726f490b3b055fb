#include "core/mesher.h"

#include "core/run/meshing_run.h"

namespace stellate::core {

Expected<std::unique_ptr<Mesher>> Mesher::Create(Specification spec) {
  if (Status status = Validate(spec); !status.ok()) return tl::unexpected<Status>(status);
  switch (spec.dimension) {
    case 1:
      return std::make_unique<MeshingRun<1>>(std::move(spec));
    case 2:
      return std::make_unique<MeshingRun<2>>(std::move(spec));
    case 3:
      return std::make_unique<MeshingRun<3>>(std::move(spec));
    case 4:
      return std::make_unique<MeshingRun<4>>(std::move(spec));
    case 5:
      return std::make_unique<MeshingRun<5>>(std::move(spec));
  }
  return Refuse(StatusCode::kLimitExceeded, "this build has no template for this dimension",
                "dimension");
}

}  // namespace stellate::core
