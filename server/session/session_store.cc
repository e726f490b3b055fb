#include "server/session/session_store.h"

#include <malloc.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

constexpr std::string_view kNamePrefix = "meshes/";
constexpr std::size_t kNameBytes = 16;
// Meshes that have ended, and are being taken apart, take no place of those that run, but there may
// be no more of them than of those, or than this.
constexpr std::size_t kLeastEnding = 16;
// For a client to fetch what it has heard the end of.
constexpr auto kGrace = std::chrono::minutes(1);
// Replays at once: what each holds beyond its share, for a round, must not add up.
constexpr std::ptrdiff_t kReplays = 2;
// How long a history that the journal has stays in memory, unread.
constexpr auto kUnread = std::chrono::seconds(10);

}  // namespace

std::string NewMeshName() {
  static constexpr char kHex[] = "0123456789abcdef";
  std::array<unsigned char, kNameBytes> bytes;
  ssize_t got = 0;
  do {
    got = getrandom(bytes.data(), bytes.size(), 0);
  } while (got < 0 && errno == EINTR);
  // A guessable name would open the mesh to anyone: better none.
  if (got != static_cast<ssize_t>(bytes.size())) throw std::runtime_error("no random bytes");
  std::string name(kNamePrefix);
  for (const unsigned char byte : bytes) {
    name += kHex[byte >> 4];
    name += kHex[byte & 15];
  }
  return name;
}

bool IsMeshName(const std::string& name) {
  if (name.size() != kNamePrefix.size() + 2 * kNameBytes || !name.starts_with(kNamePrefix)) {
    return false;
  }
  return std::all_of(name.begin() + kNamePrefix.size(), name.end(),
                     [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

SessionStore::SessionStore(StoreLimits limits, Session::MesherFactory factory)
    : factory_(std::move(factory)), limits_(limits) {}

SessionStore::~SessionStore() { Stop(TimePoint::max()); }

void SessionStore::SetLimits(StoreLimits limits) {
  const std::lock_guard lock(mutex_);
  limits_ = limits;
}

Allowed<std::shared_ptr<Session>> SessionStore::Create(SessionOptions options) {
  const std::lock_guard lock(mutex_);
  if (const auto same = numbers_.find(options.request.name); same != numbers_.end()) {
    return entries_.at(same->second).session;
  }
  std::size_t running = 0, owned = 0, ending = 0;
  const auto count = [&](const Entry& entry) {
    if (entry.session->Over()) return;
    if (entry.session->HasEnded()) {
      ++ending;
      return;
    }
    ++running;
    if (entry.session->request().owner == options.request.owner) ++owned;
  };
  for (const auto& [number, entry] : entries_) count(entry);
  for (const Entry& entry : dying_) count(entry);
  if (running >= limits_.max_running) {
    return tl::unexpected(
        Refused({"max-meshes", core::Message(limits_.max_running), "server"},
                core::Message("the server runs ", running,
                              " meshes, the most that it allows: wait for one to end, cancel one, "
                              "or raise --max-meshes")));
  }
  if (ending >= std::max(limits_.max_running, kLeastEnding)) {
    return tl::unexpected(Refused({"max-meshes", core::Message(limits_.max_running), "server"},
                                  core::Message("the server is still taking apart ", ending,
                                                " meshes that ended: ask again in a moment")));
  }
  if (!options.request.owner.empty() && owned >= limits_.max_running_of_owner) {
    return tl::unexpected(
        Refused({"owner-meshes", core::Message(limits_.max_running_of_owner), "owner"},
                core::Message("you run ", owned,
                              " meshes, the most that the server allows each owner: wait for one "
                              "to end, cancel one, or raise --owner-meshes")));
  }
  if (stopped_) {
    return tl::unexpected(
        Refused({core::StatusCode::kFailedPrecondition, "the server is stopping"}));
  }
  if (options.request.name.empty()) options.request.name = NewMeshName();
  if (new_journal_ && !options.examiner) options.ports.journal = new_journal_();
  Entry& entry = AddLocked(std::move(options), TimePoint::max());
  try {
    StartLocked(&entry);
  } catch (const std::system_error&) {
    numbers_.erase(entry.session->request().name);
    entries_.erase(entry.number);
    return tl::unexpected(Refused(
        {core::StatusCode::kLimitExceeded,
         "the system gives the server no thread for another mesh: wait for one to end, cancel one, "
         "or raise the limit on its processes (ulimit -u, TasksMax, the pids of its cgroup)"}));
  }
  return entry.session;
}

void SessionStore::Restore(SessionOptions options) {
  // The earlier of two meshes of one name was deleted before the later was made, in the last
  // instant of a server that was killed.
  Delete(options.request.name);
  const std::lock_guard lock(mutex_);
  TimePoint over_since = TimePoint::max();
  if (options.record->end) {
    SessionEnd& end = *options.record->end;
    const Clock::duration age = AgeOf(end.time);
    if (age >= limits_.keep_for) return options.ports.journal->Forget();
    over_since = Clock::now() - age;
    // As a server recorded it that did not look whether its clock had been set back.
    end.time = std::max(end.time, options.record->create_time);
    end.elapsed_seconds = std::max(end.elapsed_seconds, 0.0);
  }
  options.ports.on_replayed = [this] { Advance(); };
  const Entry& entry = AddLocked(std::move(options), over_since);
  if (entry.session->Over()) return;
  unreplayed_.push_back(entry.number);
  AdvanceLocked();
}

SessionStore::Entry& SessionStore::AddLocked(SessionOptions options, TimePoint over_since) {
  auto session = std::make_shared<Session>(std::move(options), factory_);
  const std::uint64_t number = next_number_++;
  numbers_.emplace(session->request().name, number);
  return entries_.emplace(number, Entry{number, std::move(session), {}, over_since}).first->second;
}

void SessionStore::StartLocked(Entry* entry) {
  entry->thread = std::thread([session = entry->session] { session->Run(); });
}

void SessionStore::Advance() {
  const std::lock_guard lock(mutex_);
  AdvanceLocked();
}

void SessionStore::AdvanceLocked() {
  if (stopped_) return;
  auto replays = std::count_if(entries_.begin(), entries_.end(), [](const auto& numbered) {
    const Entry& entry = numbered.second;
    return entry.thread.joinable() && entry.session->IsReplaying();
  });
  std::erase_if(unreplayed_, [&](std::uint64_t number) {
    Entry& entry = entries_.at(number);
    const auto& memory = entry.session->ports().memory;
    if (replays >= kReplays) return false;
    if (memory != nullptr && memory->TrySet(entry.session->ReplayBytes())) return false;
    try {
      StartLocked(&entry);
    } catch (const std::system_error&) {
      return false;  // no thread is to be had: later
    }
    ++replays;
    return true;
  });
}

bool SessionStore::UnloadHistories() {
  bool any = false;
  for (const auto& session : All()) any = session->history().Unload(Clock::duration::zero()) || any;
  if (any) malloc_trim(0);
  return any;
}

std::shared_ptr<Session> SessionStore::Find(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto it = numbers_.find(name);
  return it == numbers_.end() ? nullptr : entries_.at(it->second).session;
}

bool SessionStore::Delete(const std::string& name) {
  std::shared_ptr<Session> session;
  bool was_run = true;
  {
    const std::lock_guard lock(mutex_);
    const auto it = numbers_.find(name);
    if (it == numbers_.end()) return false;
    auto node = entries_.extract(it->second);
    numbers_.erase(it);
    session = node.mapped().session;
    if (session->ports().journal != nullptr) session->ports().journal->Forget();
    was_run = std::erase(unreplayed_, node.key()) == 0;
    dying_.push_back(std::move(node.mapped()));
  }
  was_run ? session->Abandon() : session->AbandonUnrun();
  return true;
}

void SessionStore::YieldElsewhere() {
  std::vector<std::shared_ptr<Session>> run, unrun;
  {
    const std::lock_guard lock(mutex_);
    for (auto it = entries_.begin(); it != entries_.end();) {
      const auto at = it++;
      const std::shared_ptr<Session> session = at->second.session;
      if (!IsElsewhere(*session)) continue;
      (std::erase(unreplayed_, at->first) == 0 ? run : unrun).push_back(session);
      numbers_.erase(session->request().name);
      dying_.push_back(std::move(at->second));
      entries_.erase(at);
    }
  }
  for (const auto& session : run) session->Suspend();
  for (const auto& session : unrun) session->AbandonUnrun();
}

SessionStore::Page SessionStore::List(std::uint64_t after, std::size_t count,
                                      const std::optional<std::string>& owner) const {
  const std::lock_guard lock(mutex_);
  Page page;
  for (auto it = entries_.upper_bound(after); it != entries_.end(); ++it) {
    if (owner && it->second.session->request().owner != *owner) continue;
    if (page.sessions.size() == count) {
      page.more = true;
      break;
    }
    page.sessions.push_back(it->second.session);
    page.numbers.push_back(it->first);
  }
  return page;
}

std::vector<std::shared_ptr<Session>> SessionStore::All() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<Session>> all;
  all.reserve(entries_.size());
  for (const auto& [number, entry] : entries_) all.push_back(entry.session);
  return all;
}

std::size_t SessionStore::Running() const {
  const std::lock_guard lock(mutex_);
  return std::count_if(entries_.begin(), entries_.end(),
                       [](const auto& e) { return !e.second.session->Over(); });
}

std::size_t SessionStore::Served() const {
  const std::lock_guard lock(mutex_);
  return std::count_if(entries_.begin(), entries_.end(), [](const auto& e) {
    const Session& session = *e.second.session;
    return !session.Over() && session.View().state == SessionState::kRunning;
  });
}

std::vector<SessionStore::Entry> SessionStore::TakeDeadLocked() {
  std::vector<Entry> dead;
  std::erase_if(dying_, [&dead](Entry& entry) {
    if (!entry.session->Over()) return false;
    if (entry.thread.joinable()) entry.thread.join();  // it has nothing left to do
    if (entry.session.use_count() > 1) return false;
    dead.push_back(std::move(entry));
    return true;
  });
  return dead;
}

// What Sweep is to forget.
std::vector<std::uint64_t> SessionStore::OutlivedLocked(TimePoint now) {
  struct Finished {
    bool has_vertices = false;
    TimePoint over_since;
    std::uint64_t number = 0;

    auto operator<=>(const Finished&) const = default;
  };
  std::vector<std::uint64_t> outlived;
  std::map<std::string, std::vector<Finished>> by_owner;
  for (auto& [number, entry] : entries_) {
    if (!entry.session->Over()) continue;
    if (entry.thread.joinable()) entry.thread.join();  // it has nothing left to do
    if (entry.over_since == TimePoint::max()) entry.over_since = now;
    if (now - entry.over_since >= limits_.keep_for) {
      outlived.push_back(number);
    } else {
      by_owner[entry.session->request().owner].push_back(
          {entry.session->HasVertices(), entry.over_since, number});
    }
  }
  for (auto& [owner, finished] : by_owner) {
    std::size_t excess = finished.size() - std::min(finished.size(), limits_.keep_finished);
    if (excess > 0) std::sort(finished.begin(), finished.end());
    for (auto it = finished.begin(); it != finished.end() && excess > 0; ++it) {
      if (it->has_vertices && now - it->over_since < kGrace) continue;
      outlived.push_back(it->number);
      --excess;
    }
  }
  return outlived;
}

void SessionStore::Sweep(TimePoint now) {
  bool any = false;
  for (const auto& session : All()) any = session->history().Unload(kUnread) || any;
  if (any) malloc_trim(0);
  std::vector<Entry> dead;  // freeing a large mesh takes time: after the lock
  const std::lock_guard lock(mutex_);
  for (const std::uint64_t number : OutlivedLocked(now)) {
    auto node = entries_.extract(number);
    const Session& session = *node.mapped().session;
    if (session.ports().journal != nullptr) session.ports().journal->Forget();
    numbers_.erase(session.request().name);
    dying_.push_back(std::move(node.mapped()));
  }
  dead = TakeDeadLocked();
  AdvanceLocked();
}

bool SessionStore::Stop(TimePoint deadline, const std::function<void()>& on_suspended) {
  std::vector<Entry> all;
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    for (auto& [number, entry] : entries_) all.push_back(std::move(entry));
    for (Entry& entry : dying_) all.push_back(std::move(entry));
    entries_.clear();
    numbers_.clear();
    dying_.clear();
    unreplayed_.clear();
  }
  for (Entry& entry : all) entry.session->Suspend();
  on_suspended();
  loader_.Stop();
  bool clean = true;
  for (Entry& entry : all) {
    if (!entry.thread.joinable()) continue;
    while (!entry.session->Over() && Clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    if (entry.session->Over()) {
      entry.thread.join();
    } else {
      entry.thread.detach();
      clean = false;
    }
  }
  return clean;
}

}  // namespace stellate::server
