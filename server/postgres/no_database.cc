// In the place of the rest of this folder where there is no libpq.

#include "server/postgres/database.h"

namespace stellate::server {

core::Expected<std::unique_ptr<Records>> OpenDatabase(const DatabaseOptions& /*options*/,
                                                      const std::function<bool()>& /*give_up*/) {
  return core::Refuse(core::StatusCode::kFailedPrecondition,
                      "--database: this stellated was built without PostgreSQL: build it with "
                      "-DSTELLATE_POSTGRES=ON, or record meshes in --data-dir");
}

}  // namespace stellate::server
