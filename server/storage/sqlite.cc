#include "server/storage/sqlite.h"

#include <cerrno>

namespace stellate::server {

Sqlite::Sqlite(sqlite3* database) : database_(database) {
  const auto count = [](void* self, sqlite3*, const char*, int pages) {
    static_cast<Sqlite*>(self)->log_pages_ = pages;
    return SQLITE_OK;
  };
  // In the place of SQLite's own, which moves a long log at the end of a write.
  sqlite3_wal_hook(database_, count, this);
}

core::Expected<std::unique_ptr<Sqlite>> Sqlite::Open(const std::string& path, bool create) {
  sqlite3* database = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | (create ? SQLITE_OPEN_CREATE : 0);
  const int result = sqlite3_open_v2(path.c_str(), &database, flags, nullptr);
  if (database == nullptr) {
    return core::Refuse(core::StatusCode::kFailedPrecondition, sqlite3_errstr(result));
  }
  auto opened = std::unique_ptr<Sqlite>(new Sqlite(database));
  sqlite3_extended_result_codes(database, 1);
  if (result != SQLITE_OK) {
    return core::Refuse(core::StatusCode::kFailedPrecondition, opened->error());
  }
  return opened;
}

bool Sqlite::Execute(const char* sql) {
  return sqlite3_exec(database_, sql, nullptr, nullptr, nullptr) == SQLITE_OK;
}

bool Sqlite::CheckpointOnClose(bool yes) {
  return sqlite3_db_config(database_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, yes ? 0 : 1, nullptr) ==
         SQLITE_OK;
}

bool Sqlite::Checkpoint() {
  if (!Execute("PRAGMA wal_checkpoint(PASSIVE)")) return false;
  log_pages_ = 0;
  return true;
}

void Sqlite::Abandon() {
  if (sqlite3_get_autocommit(database_) == 0) Execute("ROLLBACK");
}

bool Sqlite::IsFull() const {
  const int code = sqlite3_extended_errcode(database_);
  if ((code & 0xff) == SQLITE_FULL) return true;
  if ((code & 0xff) != SQLITE_IOERR) return false;
  const int system = sqlite3_system_errno(database_);
  return system == ENOSPC || system == EDQUOT || system == EFBIG;
}

Statement::Statement(Sqlite& database, const char* sql) {
  failed_ = sqlite3_prepare_v2(database.database_, sql, -1, &statement_, nullptr) != SQLITE_OK;
}

Statement& Statement::Bind(int parameter, std::int64_t value) {
  failed_ = failed_ || sqlite3_bind_int64(statement_, parameter + 1, value) != SQLITE_OK;
  return *this;
}

Statement& Statement::Bind(int parameter, std::string_view bytes) {
  failed_ = failed_ || sqlite3_bind_blob64(statement_, parameter + 1, bytes.data(), bytes.size(),
                                           SQLITE_STATIC) != SQLITE_OK;
  return *this;
}

bool Statement::Next() {
  if (failed_) return false;
  const int result = sqlite3_step(statement_);
  failed_ = result != SQLITE_ROW && result != SQLITE_DONE;
  return result == SQLITE_ROW;
}

bool Statement::Run() {
  while (Next()) {
  }
  return !failed_;
}

std::string_view Statement::Bytes(int column) const {
  const void* const data = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return {static_cast<const char*>(data), static_cast<std::size_t>(size)};
}

}  // namespace stellate::server
