#pragma once

#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "core/status.h"

namespace stellate::server {

// In a database's header: two bytes, 1: without a write-ahead log, 2: with one.
inline constexpr std::size_t kSqliteFormatAt = 18;

// As much of SQLite as the journal needs. Not thread-safe.
class Sqlite {
 public:
  // Errors: SQLite's words.
  static core::Expected<std::unique_ptr<Sqlite>> Open(const std::string& path, bool create);
  ~Sqlite() { sqlite3_close(database_); }
  Sqlite(const Sqlite&) = delete;
  Sqlite& operator=(const Sqlite&) = delete;

  // Runs statements whose rows, if any, are not wanted.
  bool Execute(const char* sql);
  // Whether what is in the write-ahead log goes into the main file when this is closed.
  bool CheckpointOnClose(bool yes);
  // Moves what is in the write-ahead log into the main file. Nothing else does before it is closed.
  bool Checkpoint();
  // Of the write-ahead log, since it was last moved.
  int log_pages() const { return log_pages_; }
  // Ends a transaction that could not be completed.
  void Abandon();

  std::string error() const { return sqlite3_errmsg(database_); }
  // The last error: the disk, its quota, or the limit on the file is used up.
  bool IsFull() const;

 private:
  friend class Statement;
  explicit Sqlite(sqlite3* database);
  sqlite3* const database_;
  int log_pages_ = 0;
};

// One statement; parameters and columns count from 0. What is bound must outlive its use. Gone, it
// leaves its own result to be asked for: one that failed must be the last to go.
class Statement {
 public:
  Statement(Sqlite& database, const char* sql);
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& Bind(int parameter, std::int64_t value);
  Statement& Bind(int parameter, std::string_view bytes);
  // True: a row is there.
  bool Next();
  // Runs to the end; false on error.
  bool Run();
  bool failed() const { return failed_; }

  std::int64_t Number(int column) const { return sqlite3_column_int64(statement_, column); }
  std::string_view Bytes(int column) const;  // until Next
  bool IsNull(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }

 private:
  sqlite3_stmt* statement_ = nullptr;
  bool failed_ = false;
};

}  // namespace stellate::server
