#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/status.h"
#include "server/storage/records.h"

namespace stellate::server {

// Opens the records of a database, by what --database takes.
using OpenRecordsOf =
    std::function<core::Expected<std::unique_ptr<Records>>(const std::string& setting)>;

// Copies all meshes from one data directory or database to another, `to` being made where it is a
// directory that is not there. Both must be without a server. Nothing is removed from `from`. Each
// mesh is read back and compared; one that `to` has already stays as it is there. A copy that was
// broken off is begun again with the same call: the mesh that it was at is copied from its start,
// and a server that meets such a mesh before removes it. Returns what was done, in lines for
// people. kFailedPrecondition: a record cannot be read or written; or a mesh is in both with other
// records.
core::Expected<std::string> CopyMeshes(const std::string& from, const std::string& to,
                                       const OpenRecordsOf& open_database);

}  // namespace stellate::server
