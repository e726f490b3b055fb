#include "server/postgres/schema.h"

#include <atomic>
#include <iterator>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::Message;
using core::Status;

// In the order in which they are applied, each once: what has been released is never changed.
//
// cluster, one row: which server may write. `term` counts the servers that had the database one
// after the other, and is the key, so that a change of it waits for writes that hold the row FOR
// KEY SHARE, and a beat, which changes no key, does not. `format` is kJournalVersion.
// records: as in a file. Their bytes are floating-point numbers, which do not compress.
constexpr const char* kMigrations[] = {
    "CREATE TABLE stellate.cluster (single boolean UNIQUE DEFAULT true CHECK (single), "
    "term bigint PRIMARY KEY, beats bigint NOT NULL, held boolean NOT NULL, holder text NOT NULL, "
    "format bigint NOT NULL) WITH (fillfactor = 10);"
    "INSERT INTO stellate.cluster (term, beats, held, holder, format) VALUES (0, 0, false, '', 0);"
    "CREATE TABLE stellate.records (mesh bigint, kind smallint, number bigint, part integer, "
    "seal bigint NOT NULL, bytes bytea NOT NULL, "
    "PRIMARY KEY (mesh, kind, number, part));"
    "ALTER TABLE stellate.records ALTER bytes SET STORAGE EXTERNAL",
};

// In one transaction, one after the other: the lock is given back with its end.
std::string Locked(const std::string& script) {
  return Message("SELECT pg_advisory_xact_lock(6004501537215346788);", script);
}

Status Trouble(const Connection& connection, const char* what) {
  return {core::StatusCode::kFailedPrecondition,
          Message("the database of --database ", what, ": ", connection.error())};
}

}  // namespace

Status PrepareSchema(Connection* connection) {
  using Outcome = Connection::Outcome;
  const std::atomic<bool> never{false};
  Rows there;
  if (connection->Run("SELECT to_regclass('stellate.migrations') IS NOT NULL", {}, &there, never) !=
      Outcome::kDone) {
    return Trouble(*connection, "cannot be asked");
  }
  // Who may not make schemas may use one that is there.
  if (!there.Flag(0, 0) &&
      connection->RunScript(Locked("CREATE SCHEMA IF NOT EXISTS stellate;"
                                   "CREATE TABLE IF NOT EXISTS stellate.migrations "
                                   "(number bigint PRIMARY KEY)")) != Outcome::kDone) {
    return Trouble(*connection, "takes no schema \"stellate\" from this user");
  }
  Rows applied;
  if (connection->Run("SELECT coalesce(max(number), 0) FROM stellate.migrations", {}, &applied,
                      never) != Outcome::kDone) {
    return Trouble(*connection, "cannot be asked");
  }
  const std::int64_t known = std::size(kMigrations), done = applied.Number(0, 0);
  if (done > known) {
    return {core::StatusCode::kFailedPrecondition,
            "the database of --database was made by a later version of stellated: run that one"};
  }
  for (std::int64_t number = done + 1; number <= known; ++number) {
    const Outcome outcome = connection->RunScript(Locked(Message(
        "INSERT INTO stellate.migrations VALUES (", number, ");", kMigrations[number - 1])));
    // Another server has done it meanwhile.
    if (outcome != Outcome::kDone && connection->state() != "23505") {
      return Trouble(*connection, "cannot be brought up to date");
    }
  }
  return Status::Ok();
}

}  // namespace stellate::server
