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
// records: as in a file. Their bytes are floating-point numbers, which do not compress.
// cluster: of servers that had a database one at a time. They find their term over, and cannot
// take another.
// common, one row: what all servers share. `format` is kJournalVersion; by `secret` they know each
// other's calls.
// servers: those that are there (server_lease.h).
// meshes: who has each, and how often it has changed hands, its epoch, which every write of its
// records checks, and holds FOR NO KEY UPDATE. `name` is null until the mesh's start is recorded,
// and once it is deleted.
constexpr const char* kMigrations[] = {
    "CREATE TABLE stellate.cluster (single boolean UNIQUE DEFAULT true CHECK (single), "
    "term bigint PRIMARY KEY, beats bigint NOT NULL, held boolean NOT NULL, holder text NOT NULL, "
    "format bigint NOT NULL) WITH (fillfactor = 10);"
    "INSERT INTO stellate.cluster (term, beats, held, holder, format) VALUES (0, 0, false, '', 0);"
    "CREATE TABLE stellate.records (mesh bigint, kind smallint, number bigint, part integer, "
    "seal bigint NOT NULL, bytes bytea NOT NULL, "
    "PRIMARY KEY (mesh, kind, number, part));"
    "ALTER TABLE stellate.records ALTER bytes SET STORAGE EXTERNAL",

    "CREATE TABLE stellate.common (single boolean UNIQUE DEFAULT true CHECK (single), "
    "format bigint NOT NULL, secret bytea NOT NULL);"
    "INSERT INTO stellate.common (format, secret) SELECT format, '' FROM stellate.cluster;"
    "UPDATE stellate.cluster SET term = term + 1, held = false;"
    "ALTER TABLE stellate.cluster ADD CHECK (NOT held);"
    "CREATE TABLE stellate.servers (id bigserial PRIMARY KEY, address text NOT NULL, "
    "beats bigint NOT NULL) WITH (fillfactor = 10);"
    "CREATE TABLE stellate.meshes (id bigint PRIMARY KEY, name bytea UNIQUE, "
    "owner bytea NOT NULL DEFAULT '', server bigint NOT NULL, epoch bigint NOT NULL, "
    "ended boolean NOT NULL DEFAULT false, bytes bigint NOT NULL DEFAULT 0) "
    "WITH (fillfactor = 50);"
    "CREATE INDEX ON stellate.meshes (server);"
    "CREATE INDEX ON stellate.meshes (owner) WHERE NOT ended;"
    "INSERT INTO stellate.meshes (id, server, epoch) "
    "SELECT DISTINCT mesh, 0::int8, 0::int8 FROM stellate.records;"
    "CREATE SEQUENCE stellate.mesh_ids;"
    "SELECT setval('stellate.mesh_ids', (SELECT coalesce(max(id), 0) + 1 FROM stellate.meshes), "
    "false);"
    // 0: the mesh is there, also if it was begun before; 1: another has the name; 2: its owner has
    // as many. A function's statements see what was committed before each, so that the count comes
    // after the lock.
    "CREATE FUNCTION stellate.begin_mesh(new_id bigint, new_name bytea, new_owner bytea, "
    "new_server bigint, most bigint) RETURNS bigint LANGUAGE plpgsql AS $$ BEGIN "
    "IF EXISTS (SELECT FROM stellate.meshes WHERE id = new_id) THEN RETURN 0; END IF;"
    "IF most > 0 AND new_owner <> '' THEN "
    "PERFORM pg_advisory_xact_lock(hashtextextended(encode(new_owner, 'hex'), "
    "6004501537215346788));"
    "IF (SELECT count(*) FROM stellate.meshes WHERE owner = new_owner AND NOT ended) >= most "
    "THEN RETURN 2; END IF; END IF;"
    "INSERT INTO stellate.meshes (id, name, owner, server, epoch) "
    "VALUES (new_id, nullif(new_name, ''), new_owner, new_server, 1) ON CONFLICT DO NOTHING;"
    "IF EXISTS (SELECT FROM stellate.meshes WHERE id = new_id) THEN RETURN 0; END IF;"
    "RETURN 1; END $$",
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
