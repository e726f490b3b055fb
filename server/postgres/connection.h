#pragma once

#include <libpq-fe.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"

namespace stellate::server {

// The parameters of a statement, $1, $2, ..., in the binary format. What is added is copied.
class Parameters {
 public:
  Parameters& Add(std::int64_t value);                        // int8
  Parameters& Add(std::string_view text);                     // text
  Parameters& Add(const std::vector<std::int64_t>& values);   // int8[]
  Parameters& AddBytes(const std::string& bytes);             // bytea
  Parameters& AddBytes(const std::vector<std::string>& all);  // bytea[]

 private:
  friend class Connection;
  Parameters& Push(Oid type, std::string bytes);
  std::vector<Oid> types_;
  std::vector<std::string> values_;
};

// The rows of a statement: int8, bool and bytea columns, which count from 0.
class Rows {
 public:
  Rows() = default;
  explicit Rows(PGresult* result) : result_(result, PQclear) {}

  int count() const { return result_ == nullptr ? 0 : PQntuples(result_.get()); }
  std::int64_t Number(int row, int column) const;
  bool Flag(int row, int column) const { return Bytes(row, column) == std::string_view("\1", 1); }
  // Also a text column's. Valid while this is there.
  std::string_view Bytes(int row, int column) const;

 private:
  std::shared_ptr<PGresult> result_;
};

// As much of libpq as the records need: statements that are sent whole, each a transaction of its
// own, so that a server that is frozen or cut off in the middle of one holds no lock. Nothing is
// prepared by name, so that poolers of connections may stand in between. One thread at a time.
class Connection {
 public:
  // `url`: what libpq takes, several hosts included. Waits for seconds. Errors: libpq's words.
  static core::Expected<std::unique_ptr<Connection>> Open(const std::string& url);
  // After an Open that failed: whether nothing answers there, or not yet, so that it may succeed
  // later. Waits for seconds.
  static bool IsAway(const std::string& url);
  ~Connection() { PQfinish(connection_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  enum class Outcome {
    kDone,
    kAway,   // the database does not answer, or not now, or not within two seconds of `stop`: open
             // another connection, and ask again. What was asked may have been done
    kFull,   // its disk is full; nothing was done
    kFault,  // it refuses the statement; nothing was done
  };
  Outcome Run(const char* sql, const Parameters& parameters, Rows* rows,
              const std::atomic<bool>& stop);
  // Several statements, one transaction, whose rows are not wanted.
  Outcome RunScript(const std::string& sql);
  // Of the last Run or RunScript that was not done.
  const std::string& error() const { return error_; }
  // The same as SQL names it, five characters; empty: the connection broke.
  const std::string& state() const { return state_; }

 private:
  explicit Connection(PGconn* connection) : connection_(connection) {}
  bool Exchange(const std::atomic<bool>& stop);
  bool Await(short events, const std::atomic<bool>& stop);
  Outcome Judge(PGresult* result);

  PGconn* const connection_;
  std::string error_, state_;
};

// Whether the database may do later what it refuses now, by SQL's name of the reason.
bool IsPassing(std::string_view state);

}  // namespace stellate::server
