#include "server/postgres/database_url.h"

#include <libpq-fe.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <string_view>

#include "core/base/message.h"
#include "server/base/log.h"

namespace stellate::server {
namespace {

using core::Message;

tl::unexpected<core::Status> Invalid(std::string message) {
  return core::Refuse(core::StatusCode::kInvalidArgument, std::move(message));
}

bool IsUrl(std::string_view text) {
  return text.starts_with("postgresql://") || text.starts_with("postgres://");
}

using Options = std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)>;
using Words = std::map<std::string, std::string>;

// What is set, of all that libpq knows.
void Note(const PQconninfoOption* option, Words* words) {
  for (; option != nullptr && option->keyword != nullptr; ++option) {
    if (option->val != nullptr) (*words)[option->keyword] = option->val;
  }
}

// Such that nobody on another machine can listen in.
bool IsOfThisMachine(std::string_view host) {
  return host.empty() || host.front() == '/' || host.front() == '@' || host == "localhost" ||
         host.starts_with("127.") || host == "::1";
}

bool AreAllOfThisMachine(std::string_view hosts) {
  while (true) {
    const std::size_t end = hosts.find(',');
    if (!IsOfThisMachine(hosts.substr(0, end))) return false;
    if (end == std::string_view::npos) return true;
    hosts.remove_prefix(end + 1);
  }
}

core::Expected<std::string> ReadFile(const std::string& path) {
  std::ifstream file(path);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file.good() && !file.eof()) {
    return Invalid(Message("--database ", path, " is no URL (postgresql://...), and no file that ",
                           "can be read: ", std::strerror(errno)));
  }
  struct stat info {};
  if (stat(path.c_str(), &info) == 0 && (info.st_mode & 0007) != 0) {
    Log(LogLevel::kWarning, {},
        Message("--database ", path, " can be read by every user of this machine: chmod 600"));
  }
  text.erase(text.find_last_not_of(" \t\r\n") + 1);
  text.erase(0, text.find_first_not_of(" \t\r\n"));
  if (!IsUrl(text)) {
    return Invalid(Message("--database ", path, " holds no URL: write one line, ",
                           "postgresql://USER@HOST/DATABASE, into it"));
  }
  return text;
}

}  // namespace

core::Expected<std::string> ReadDatabaseUrl(const std::string& setting) {
  const bool shown = IsUrl(setting);
  auto url = shown ? core::Expected<std::string>(setting) : ReadFile(setting);
  if (!url) return url;
  char* complaint = nullptr;
  const Options parsed(PQconninfoParse(url->c_str(), &complaint), PQconninfoFree);
  if (parsed == nullptr) {
    const std::string words = complaint == nullptr ? "" : complaint;
    PQfreemem(complaint);
    return Invalid(
        Message("--database is no URL of PostgreSQL: ", words.substr(0, words.find('\n'))));
  }
  Words said, all;
  Note(parsed.get(), &said);
  if (shown && said.contains("password")) {
    return Invalid(
        "--database has a password in it, which every user of this machine can see among the "
        "processes: write the URL into a file that only the server's user can read, and name that");
  }
  if (said.contains("service")) {
    return Invalid(
        "--database names a service: write its host and its sslmode into the URL, so "
        "that the server knows who can listen in");
  }
  const Options defaults(PQconndefaults(), PQconninfoFree);
  Note(defaults.get(), &all);  // those of the environment
  for (const auto& [key, value] : said) all[key] = value;
  if (AreAllOfThisMachine(all["host"]) && AreAllOfThisMachine(all["hostaddr"])) return url;
  if (all["sslmode"] == "verify-full") return url;
  return Invalid(
      Message("--database goes to ", all["host"].empty() ? all["hostaddr"] : all["host"],
              ", and others could read what is recorded or take the database's place: add "
              "sslmode=verify-full to the URL, and sslrootcert=FILE where the authority is your "
              "own"));
}

}  // namespace stellate::server
