#pragma once

// The statements of PostgresRecords, over the tables of schema.cc. Those that write do nothing for
// a mesh of another epoch, and may be repeated.
namespace stellate::server::statements {

// The mesh's row is locked, so that a takeover waits for what is being written, and a write that
// came after it finds no row and does nothing. $1: the mesh; $2: its epoch, as this server has it.
#define STELLATE_MINE \
  "WITH mine AS (SELECT id FROM stellate.meshes WHERE id = $1 AND epoch = $2 FOR NO KEY UPDATE), "

// Of several meshes. $1, $2: them and their epochs; $3: what their records will have in bytes;
// $4: whether they end by this; $5, $6: their names and owners, where they are begun.
inline constexpr char kPut[] =
    "WITH mine AS (SELECT m.id, e.bytes, e.ended, e.name, e.owner FROM stellate.meshes AS m, "
    "unnest($1, $2, $3, $4, $5, $6) AS e (id, epoch, bytes, ended, name, owner) "
    "WHERE m.id = e.id AND m.epoch = e.epoch FOR NO KEY UPDATE OF m), "
    "put AS (INSERT INTO stellate.records AS r (mesh, kind, number, part, seal, bytes) "
    "SELECT p.mesh, p.kind, p.number, p.part, p.seal, p.bytes FROM mine, "
    "unnest($7, $8, $9, $10, $11, $12) AS p (mesh, kind, number, part, seal, bytes) "
    "WHERE p.mesh = mine.id "
    "ON CONFLICT (mesh, kind, number, part) DO UPDATE SET seal = excluded.seal, "
    "bytes = excluded.bytes WHERE r.seal <> excluded.seal), "
    "note AS (UPDATE stellate.meshes AS m SET bytes = mine.bytes, "
    "ended = m.ended OR mine.ended > 0, name = coalesce(nullif(mine.name, ''), m.name), "
    "owner = CASE WHEN mine.name = '' THEN m.owner ELSE mine.owner END "
    "FROM mine WHERE m.id = mine.id) "
    "SELECT id FROM mine";
inline constexpr char kRemove[] = STELLATE_MINE
    "gone AS (DELETE FROM stellate.records AS r USING mine WHERE r.mesh = mine.id AND kind = $3 "
    "AND number = $4 AND part = $5) "
    "SELECT id FROM mine";
// The last rounds first: what is left has no gap. A mesh's mark is the last to go.
inline constexpr char kRemoveSome[] = STELLATE_MINE
    "gone AS (DELETE FROM stellate.records AS r USING mine, "
    "(SELECT mesh, kind, number, part FROM stellate.records WHERE mesh = $1 AND kind BETWEEN $3 "
    "AND $4 ORDER BY number DESC, kind DESC, part DESC LIMIT $5) AS s "
    "WHERE (r.mesh, r.kind, r.number, r.part) = (s.mesh, s.kind, s.number, s.part)) "
    "SELECT id FROM mine";
// The name is free, and no call finds the mesh any more.
inline constexpr char kUnname[] =
    "UPDATE stellate.meshes SET name = NULL, ended = true WHERE id = $1 AND epoch = $2 "
    "RETURNING id";
inline constexpr char kForget[] =
    "DELETE FROM stellate.meshes WHERE id = $1 AND epoch = $2 RETURNING id";
inline constexpr char kBegin[] = "SELECT stellate.begin_mesh($1, $2, $3, $4, $5)";
inline constexpr char kNewMesh[] = "SELECT nextval('stellate.mesh_ids')";

// A share of the meshes whose servers are gone, or that of the name $2. What is locked is being
// written, or taken up, by another. Not by a server that is gone itself.
inline constexpr char kAdopt[] =
    "WITH orphan AS (SELECT m.id FROM stellate.meshes AS m, stellate.servers AS me "
    "WHERE me.id = $1 AND ($2 = '' OR m.name = $2) AND "
    "NOT EXISTS (SELECT FROM stellate.servers AS s WHERE s.id = m.server) "
    "ORDER BY m.id LIMIT (SELECT greatest(2, (SELECT count(*) FROM stellate.meshes AS o WHERE "
    "NOT EXISTS (SELECT FROM stellate.servers AS s WHERE s.id = o.server)) "
    "/ (SELECT count(*) FROM stellate.servers) + 1)) FOR UPDATE OF m SKIP LOCKED) "
    "UPDATE stellate.meshes AS m SET server = $1, epoch = m.epoch + 1 FROM orphan "
    "WHERE m.id = orphan.id RETURNING m.id";
// What this server has, and does not know of: also where it did not hear that it had taken it up.
inline constexpr char kUnknown[] =
    "SELECT id, epoch, name IS NULL, ended FROM stellate.meshes "
    "WHERE server = $1 AND NOT id = ANY ($2)";
// This server was away, and has another row: the meshes that no other took up meanwhile are its
// own, as they are.
inline constexpr char kRenew[] =
    "WITH me AS (INSERT INTO stellate.servers (address, beats) VALUES ($1, 0) RETURNING id), "
    "back AS (UPDATE stellate.meshes AS m SET server = me.id FROM me, "
    "unnest($2, $3) AS e (id, epoch) WHERE m.id = e.id AND m.epoch = e.epoch RETURNING m.id) "
    "SELECT me.id, back.id FROM me LEFT JOIN back ON true";
inline constexpr char kName[] =
    "UPDATE stellate.meshes SET name = $2, owner = $3, ended = $4 > 0, bytes = $5 "
    "WHERE id = $1 AND name IS NULL AND NOT EXISTS (SELECT FROM stellate.meshes WHERE name = $2) "
    "RETURNING id";
inline constexpr char kLocate[] =
    "SELECT m.server, s.id IS NULL, coalesce(s.address, '') FROM stellate.meshes AS m "
    "LEFT JOIN stellate.servers AS s ON s.id = m.server WHERE m.name = $1";
inline constexpr char kElsewhere[] =
    "SELECT owner, sum(bytes)::int8 FROM stellate.meshes WHERE server <> $1 GROUP BY owner";
inline constexpr char kMeasure[] =
    "SELECT coalesce(sum(octet_length(bytes)), 0)::int8, "
    "count(*) FILTER (WHERE kind BETWEEN $2 AND $3) FROM stellate.records WHERE mesh = $1";
inline constexpr char kRead[] =
    "SELECT seal, bytes FROM stellate.records WHERE mesh = $1 AND kind = $2 AND number = $3 AND "
    "part = $4";
inline constexpr char kList[] =
    "SELECT kind::int8, number, part::int8 FROM stellate.records WHERE mesh = $1 "
    "ORDER BY kind, number, part";
// Answers and histories are large: of them it is enough to know that there are some.
inline constexpr char kLoad[] =
    "SELECT mesh, kind::int8, number, part::int8, seal, bytes FROM stellate.records "
    "WHERE mesh = ANY ($3) AND kind NOT IN ($1, $2) ORDER BY mesh, kind, number, part";
inline constexpr char kLoadSizes[] =
    "SELECT mesh, kind::int8, sum(octet_length(bytes))::int8 FROM stellate.records "
    "WHERE mesh = ANY ($1) GROUP BY mesh, kind";
#undef STELLATE_MINE

}  // namespace stellate::server::statements
