#include "server/postgres/database.h"

#include <unistd.h>

#include <array>
#include <utility>

#include "core/base/message.h"
#include "server/postgres/database_lease.h"
#include "server/postgres/database_url.h"
#include "server/postgres/postgres_records.h"

namespace stellate::server {
namespace {

std::string HostName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

}  // namespace

core::Expected<std::unique_ptr<Records>> OpenDatabase(const DatabaseOptions& options,
                                                      const std::function<bool()>& give_up) {
  const auto url = ReadDatabaseUrl(options.setting);
  if (!url) return tl::unexpected(url.error());
  auto lease = DatabaseLease::Take(
      *url, {core::Message(HostName(), " ", options.server), options.patience, options.on_answer},
      give_up);
  if (!lease) return tl::unexpected(std::move(lease.error()));
  return PostgresRecords::Open(*url, std::move(*lease), {options.max_bytes, options.patience});
}

}  // namespace stellate::server
