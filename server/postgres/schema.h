#pragma once

#include "core/status.h"
#include "server/postgres/connection.h"

namespace stellate::server {

// Makes the tables in the schema "stellate", or brings those of an earlier server up to date.
// Servers that do so at the same time wait for each other. kFailedPrecondition: a later server made
// them, or the database does not let this user.
core::Status PrepareSchema(Connection* connection);

}  // namespace stellate::server
