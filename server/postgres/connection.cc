#include "server/postgres/connection.h"

#include <endian.h>
#include <poll.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace stellate::server {
namespace {

// PostgreSQL's numbers of types, from its catalogue; they never change.
constexpr Oid kInt8 = 20, kText = 25, kBytea = 17, kInt8Array = 1016, kByteaArray = 1001;
constexpr int kLook = 100;      // milliseconds between looks at `stop`
constexpr int kLastLooks = 20;  // after which a statement is given up then

void Append32(std::uint32_t value, std::string* bytes) {
  value = htobe32(value);
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string Big64(std::int64_t value) {
  const std::uint64_t big = htobe64(static_cast<std::uint64_t>(value));
  return {reinterpret_cast<const char*>(&big), sizeof big};
}

// Of one dimension, whose elements are appended next: each its length, and its bytes.
std::string ArrayOf(Oid element, std::size_t count) {
  std::string bytes;
  for (const std::uint32_t word :
       {1u, 0u, static_cast<std::uint32_t>(element), static_cast<std::uint32_t>(count), 1u}) {
    Append32(word, &bytes);
  }
  return bytes;
}

void AppendElement(std::string_view element, std::string* bytes) {
  Append32(static_cast<std::uint32_t>(element.size()), bytes);
  bytes->append(element);
}

// Defaults, before what the URL says. A line that is cut must not be waited for until TCP gives up
// by itself, after a quarter of an hour.
constexpr std::array kNames = {
    "application_name", "connect_timeout",  "keepalives_idle", "keepalives_interval",
    "keepalives_count", "tcp_user_timeout", "dbname",          static_cast<const char*>(nullptr)};

std::array<const char*, kNames.size()> ValuesFor(const std::string& url) {
  return {"stellated", "3", "5", "2", "3", "10000", url.c_str(), nullptr};
}

// The first of libpq's lines.
std::string FirstLine(const char* words) {
  const std::string_view all(words);
  return std::string(all.substr(0, all.find('\n')));
}

}  // namespace

Parameters& Parameters::Push(Oid type, std::string bytes) {
  types_.push_back(type);
  values_.push_back(std::move(bytes));
  return *this;
}

Parameters& Parameters::Add(std::int64_t value) { return Push(kInt8, Big64(value)); }

Parameters& Parameters::Add(std::string_view text) { return Push(kText, std::string(text)); }

Parameters& Parameters::Add(const std::vector<std::int64_t>& values) {
  std::string bytes = ArrayOf(kInt8, values.size());
  for (const std::int64_t value : values) AppendElement(Big64(value), &bytes);
  return Push(kInt8Array, std::move(bytes));
}

Parameters& Parameters::AddBytes(const std::string& bytes) { return Push(kBytea, bytes); }

Parameters& Parameters::AddBytes(const std::vector<std::string>& all) {
  std::string bytes = ArrayOf(kBytea, all.size());
  for (const std::string& one : all) AppendElement(one, &bytes);
  return Push(kByteaArray, std::move(bytes));
}

std::string_view Rows::Bytes(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column),
          static_cast<std::size_t>(PQgetlength(result_.get(), row, column))};
}

std::int64_t Rows::Number(int row, int column) const {
  std::uint64_t big = 0;
  const std::string_view bytes = Bytes(row, column);
  if (bytes.size() == sizeof big) std::memcpy(&big, bytes.data(), sizeof big);
  return static_cast<std::int64_t>(be64toh(big));
}

core::Expected<std::unique_ptr<Connection>> Connection::Open(const std::string& url) {
  std::unique_ptr<Connection> made(
      new Connection(PQconnectdbParams(kNames.data(), ValuesFor(url).data(), /*expand_dbname=*/1)));
  PGconn* const connection = made->connection_;
  if (connection == nullptr || PQstatus(connection) != CONNECTION_OK ||
      PQsetnonblocking(connection, 1) != 0) {
    return core::Refuse(core::StatusCode::kFailedPrecondition,
                        FirstLine(PQerrorMessage(connection)));
  }
  return made;
}

bool Connection::IsAway(const std::string& url) {
  const PGPing answer = PQpingParams(kNames.data(), ValuesFor(url).data(), /*expand_dbname=*/1);
  return answer == PQPING_NO_RESPONSE || answer == PQPING_REJECT;
}

// False: `stop` came a while ago, or the connection cannot be waited for.
bool Connection::Await(short events, const std::atomic<bool>& stop) {
  pollfd socket{PQsocket(connection_), events, 0};
  for (int looks = 0; looks < kLastLooks; looks += stop ? 1 : 0) {
    const int ready = poll(&socket, 1, kLook);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
  return false;
}

// Sends what is to be sent, and waits for the answer.
bool Connection::Exchange(const std::atomic<bool>& stop) {
  while (true) {
    const int left = PQflush(connection_);
    if (left < 0) return false;
    if (left == 0 && PQisBusy(connection_) == 0) return true;
    if (!Await(left > 0 ? POLLIN | POLLOUT : POLLIN, stop)) return false;
    if (PQconsumeInput(connection_) == 0) return false;
  }
}

Connection::Outcome Connection::Run(const char* sql, const Parameters& parameters, Rows* rows,
                                    const std::atomic<bool>& stop) {
  state_.clear();
  const std::size_t count = parameters.values_.size();
  std::vector<const char*> values(count);
  std::vector<int> lengths(count), formats(count, 1);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = parameters.values_[i].data();
    lengths[i] = static_cast<int>(parameters.values_[i].size());
  }
  if (PQsendQueryParams(connection_, sql, static_cast<int>(count), parameters.types_.data(),
                        values.data(), lengths.data(), formats.data(), /*resultFormat=*/1) == 0 ||
      !Exchange(stop)) {
    error_ = stop ? "the server stops" : FirstLine(PQerrorMessage(connection_));
    return Outcome::kAway;
  }
  PGresult* const result = PQgetResult(connection_);
  Rows all(result);
  const Outcome outcome = Judge(result);
  if (outcome != Outcome::kDone) return outcome;
  while (true) {
    if (!Exchange(stop)) return Outcome::kAway;
    PGresult* const more = PQgetResult(connection_);
    if (more == nullptr) break;
    PQclear(more);
  }
  if (rows != nullptr) *rows = std::move(all);
  return Outcome::kDone;
}

Connection::Outcome Connection::RunScript(const std::string& sql) {
  state_.clear();
  PGresult* const result = PQexec(connection_, sql.c_str());
  const Rows all(result);
  return Judge(result);
}

Connection::Outcome Connection::Judge(PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  if (status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK) return Outcome::kDone;
  const char* const state =
      result == nullptr ? nullptr : PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const char* const words =
      result == nullptr ? nullptr : PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
  state_ = state == nullptr ? "" : state;
  error_ = words == nullptr ? FirstLine(PQerrorMessage(connection_)) : words;
  if (state_.empty() || PQstatus(connection_) != CONNECTION_OK || IsPassing(state_)) {
    return Outcome::kAway;
  }
  return state_ == "53100" ? Outcome::kFull : Outcome::kFault;
}

bool IsPassing(std::string_view state) {
  // Connections; what an operator or a stop of the database does; too many connections; a standby
  // that takes no writes yet; deadlocks and the like; a statement that was cancelled.
  for (const std::string_view passing : {"08", "57P", "53300", "25006", "40", "57014"}) {
    if (state.starts_with(passing)) return true;
  }
  return false;
}

}  // namespace stellate::server
