// A journal's files, damaged: refused without a changed byte, or read as a history that leads to
// the very meshes that were recorded. An input is one byte that chooses what lay on the disk, and
// changes to it: an operation, three bytes for the place, one for the length, and bytes.

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "server/journal/journal.h"
#include "tests/fuzz/scripted_session.h"

namespace stellate::fuzz {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;  // name to contents

// In memory where there is such a place: each input is written to files and synced.
class Folder {
 public:
  Folder() {
    const fs::path memory = "/dev/shm";
    const fs::path base = access(memory.c_str(), W_OK) == 0 ? memory : fs::temp_directory_path();
    path_ = base / ("stellate-fuzz-" + std::to_string(getpid()));
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string path() const { return path_; }

  void Write(const Files& files) const {
    for (const auto& entry : fs::directory_iterator(path_)) fs::remove_all(entry.path());
    for (const auto& [name, bytes] : files) {
      std::ofstream(path_ / name, std::ios::binary)
          .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    }
  }
  // The database and its log; what only serves running servers is left out.
  Files Read() const {
    Files files;
    for (const auto& entry : fs::directory_iterator(path_)) {
      const std::string name = entry.path().filename();
      if (name != "journal.sqlite" && name != "journal.sqlite-wal") continue;
      std::ifstream file(entry.path(), std::ios::binary);
      files[name] = {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    }
    return files;
  }

 private:
  fs::path path_;
};

const Folder& TheFolder() {
  static const Folder folder;
  return folder;
}

struct Recorded {
  Files closed, open;  // after a server has left in order, and while it ran
  std::string geometry;
};

// Two meshes, one finished and one that its server left behind.
const Recorded& TheRecord() {
  static const Recorded recorded = [] {
    Recorded made;
    TheFolder().Write({});
    auto journal = server::Journal::Open({TheFolder().path()});
    Require(journal.has_value(), "a journal can be begun");
    server::SessionOptions options = SmallSphere();
    options.ports.journal = (*journal)->NewMesh();
    {
      server::Session session(options);
      Script truth(nullptr, 0);
      Play(&session, &truth);
      Require(session.View().state == server::SessionState::kSucceeded, "truth is enough");
      made.geometry = GeometryOf(session);
    }
    options.request.name = "meshes/11111111111111111111111111111111";
    options.ports.journal = (*journal)->NewMesh();
    {
      server::Session session(options);
      const std::string suspend = std::string(12, '\0') + SuspendAct();
      Script script(reinterpret_cast<const std::uint8_t*>(suspend.data()), suspend.size());
      Play(&session, &script);
    }
    options.ports.journal.reset();
    made.open = TheFolder().Read();
    journal->reset();
    made.closed = TheFolder().Read();
    return made;
  }();
  return recorded;
}

void Damage(Script* script, Files* files) {
  while (!script->empty()) {
    const std::uint8_t operation = script->Byte();
    const std::size_t place = script->Number(3);
    const std::string bytes = script->Bytes(script->Byte());
    auto file = files->begin();
    if ((operation & 1) != 0) file = std::prev(files->end());
    std::string& contents = file->second;
    const std::size_t at = contents.empty() ? 0 : place % contents.size();
    switch (operation >> 1 & 3) {
      case 0:
        contents.replace(at, std::min(bytes.size(), contents.size() - at), bytes);
        break;
      case 1:
        contents.resize(at);
        break;
      case 2:
        contents += bytes;
        break;
      default:
        if (!contents.empty()) contents[at] ^= static_cast<char>(1 << (bytes.size() & 7));
        break;
    }
  }
}

// Every mesh that is read back goes on to the mesh that it was to become.
void GoOn(server::Journal* journal, const std::string& geometry) {
  for (server::SessionOptions& options : journal->TakeMeshes()) {
    options.request.timeouts = SmallSphere().request.timeouts;
    options.policy = SmallSphere().policy;
    server::Session session(options);
    if (!session.Over()) {  // else its result was recorded, and is read
      Script truth(nullptr, 0);
      Play(&session, &truth);
    }
    Require(session.history().Load() == server::HistoryShelf::Loading::kDone,
            "its history can be read");
    const server::SessionView view = session.View();
    // Less may have been kept than was recorded, never anything else.
    Require(view.state == server::SessionState::kSucceeded, "what is read back can go on");
    Require(GeometryOf(session) == geometry, "and leads to the same mesh");
  }
}

}  // namespace

std::vector<std::string> Seeds() {
  const Recorded& record = TheRecord();
  std::vector<std::string> seeds{std::string(1, '\0'), std::string(1, '\1')};
  for (const bool open : {false, true}) {
    for (const auto& [name, bytes] : open ? record.open : record.closed) {
      const bool last = open && name == "journal.sqlite-wal";
      for (std::size_t place = 0; place < bytes.size(); place += 1 + bytes.size() / 5) {
        for (int operation = 0; operation < 4; ++operation) {
          std::string seed(1, open ? '\1' : '\0');
          seed.push_back(static_cast<char>(operation << 1 | (last ? 1 : 0)));
          for (const int shift : {16, 8, 0}) seed.push_back(static_cast<char>(place >> shift));
          seeds.push_back(seed + std::string("\4abcd"));
        }
      }
    }
  }
  return seeds;
}

}  // namespace stellate::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stellate;
  using namespace stellate::fuzz;
  const Recorded& record = TheRecord();
  Script script(data, size);
  Files files = (script.Byte() & 1) != 0 ? record.open : record.closed;
  Damage(&script, &files);
  TheFolder().Write(files);
  auto journal = server::Journal::Open({TheFolder().path()});
  if (!journal) {
    Require(!journal.error().message.empty(), "a refusal has words");
    const Files after = TheFolder().Read();  // with an empty log, perhaps, that was not there
    for (const auto& [name, bytes] : files) {
      Require(after.contains(name) && after.at(name) == bytes, "what is refused is left as it is");
    }
    return 0;
  }
  GoOn(journal->get(), record.geometry);
  return 0;
}
