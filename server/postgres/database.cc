#include "server/postgres/database.h"

#include <utility>

#include "server/postgres/database_url.h"
#include "server/postgres/postgres_records.h"
#include "server/postgres/server_lease.h"

namespace stellate::server {

core::Expected<std::unique_ptr<Records>> OpenDatabase(const DatabaseOptions& options,
                                                      const std::function<bool()>& give_up) {
  const auto url = ReadDatabaseUrl(options.setting);
  if (!url) return tl::unexpected(url.error());
  auto lease =
      ServerLease::Take(*url, {options.patience, options.on_answer, options.alone}, give_up);
  if (!lease) return tl::unexpected(std::move(lease.error()));
  return PostgresRecords::Open(*url, std::move(*lease), {options.max_bytes, options.patience});
}

}  // namespace stellate::server
