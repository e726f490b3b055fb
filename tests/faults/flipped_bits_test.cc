// Single bits flipped anywhere in what a killed server left: the next one refuses the journal by
// name, or finds every record as it was written. Of what it refuses, --salvage keeps all but what
// it says is lost.
//
// $STELLATE_FLIPS: how many (150); $STELLATE_SALVAGES: of how many of those that are refused the
// rest is salvaged (20); $STELLATE_FAULT_SEED: of the bits (1).

#include <algorithm>
#include <iostream>
#include <map>
#include <random>

#include "server/salvage/salvage.h"
#include "tests/faults/fault_test.h"
#include "tests/server/support/journal_fixture.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;
using testing::ContentOf;
using testing::FromEnvironment;
using testing::Overwrite;
using testing::RecordedSphere;
using testing::RunMesh;
using testing::WriteRounds;

constexpr const char* kFiles[] = {"/journal.sqlite", "/journal.sqlite-wal", "/journal.mark"};

class FlippedBits : public testing::JournalTest {
 protected:
  SessionOptions Named(Journal* journal, int number) {
    SessionOptions options = RecordedSphere(journal->NewMesh());
    options.request.name = core::Message("meshes/", std::string(31, '0'), number);
    return options;
  }

  // Two finished meshes in the file; one, and one that is under way, in its log.
  void MakePristine() {
    {
      const auto journal = Open();
      for (int number = 1; number <= 2; ++number) RunMesh(Named(journal.get(), number));
    }
    const auto journal = Open();
    RunMesh(Named(journal.get(), 3));
    const auto under_way = WriteRounds(journal.get(), 3, 50);
    // Until the threads of the journal have nothing more to do: the mark comes last. The WAL is
    // empty where they have carried all of it into the database by then.
    std::map<std::string, std::string> before;
    do {
      before = files_;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      for (const char* name : kFiles) files_[name] = ContentOf(directory_ + name);
    } while (files_ != before || files_.at(kFiles[2]).empty());
    work_ = directory_ + "-flipped";
    Restore();
    EXPECT_TRUE(Compare()) << "not even without a flip";
  }

  void Restore() const {
    fs::remove_all(work_);
    fs::create_directory(work_);
    for (const auto& [name, content] : files_) Overwrite(work_ + name, content);
  }

  // Every record of the journal in `work_`; nothing: it is refused.
  std::optional<std::map<Place, std::string>> Records(std::string* refusal) const {
    auto directory = DataDirectory::Open(work_);
    auto journal = (*directory)->OpenJournal();
    if (!journal) {
      *refusal = journal.error().message;
      return std::nullopt;
    }
    (*journal)->database().CheckpointOnClose(false);
    std::map<Place, std::string> records;
    for (const auto& [mesh, stored] : (*journal)->TakeMeshes()) {
      for (std::int64_t kind = 1; kind <= 7; ++kind) {
        for (std::int64_t number = 0; number <= 64; ++number) {
          for (std::int64_t part = 0;; ++part) {
            const Place place{mesh, static_cast<RecordKind>(kind), number, part};
            std::string record;
            const auto found = (*journal)->Read(place, &record);
            EXPECT_NE(found, JournalFile::Found::kDamaged);
            if (found != JournalFile::Found::kYes) break;
            records[place] = record;
          }
        }
      }
    }
    return records;
  }

  // False: refused. Fails the test if anything is other than it was.
  bool Compare() {
    std::string refusal;
    const auto records = Records(&refusal);
    if (!records) {
      EXPECT_NE(refusal.find("damaged"), std::string::npos) << refusal;
      return false;
    }
    if (records_.empty()) records_ = *records;
    EXPECT_TRUE(*records == records_) << "a silent loss";
    return true;
  }

  // What is kept is as it was, and a mesh is kept or said to be lost. How many finished ones are.
  int Salvage() {
    const auto said = SalvageDataDir(work_);
    EXPECT_TRUE(said) << said.error().message;
    if (!said) return 0;
    std::string refusal;
    const auto records = Records(&refusal);
    EXPECT_TRUE(records) << refusal;
    int finished = 0;
    std::map<std::int64_t, int> kept;
    for (const auto& [place, record] : *records) {
      EXPECT_TRUE(records_.contains(place) && records_.at(place) == record);
      ++kept[place.mesh];
      if (place.kind == RecordKind::kResult) ++finished;
    }
    std::map<std::int64_t, int> due;
    for (const auto& [place, record] : records_) ++due[place.mesh];
    for (const auto& [mesh, count] : due) {
      if (kept[mesh] == count) continue;
      const std::string name = core::Message(std::string(31, '0'), mesh);
      EXPECT_TRUE(kept[mesh] == 0 || said->find("lost: ") != std::string::npos ||
                  said->find("replayed") != std::string::npos || mesh == 4)
          << *said;
    }
    EXPECT_NE(said->find("damaged-1"), std::string::npos);
    EXPECT_TRUE(fs::exists(work_ + "/damaged-1/journal.sqlite"));
    return finished;
  }

  std::string work_;
  std::map<std::string, std::string> files_;
  std::map<Place, std::string> records_;
};

TEST_F(FlippedBits, NoneIsSilentlyALoss) {
  MakePristine();
  const int flips = FromEnvironment("STELLATE_FLIPS", 150);
  int salvages = FromEnvironment("STELLATE_SALVAGES", 20), salvaged = 0, finished = 0;
  std::mt19937_64 random(static_cast<unsigned>(FromEnvironment("STELLATE_FAULT_SEED", 1)));
  std::map<std::string, int> refused, harmless;
  for (int flip = 0; flip < flips && !HasFailure(); ++flip) {
    const char* name = kFiles[random() % 10 == 0 ? 2 : random() % 2];
    if (files_.at(name).empty()) name = kFiles[0];
    std::string content = files_.at(name);
    const std::uint64_t bit = random() % (8 * content.size());
    content[bit / 8] = static_cast<char>(content[bit / 8] ^ (1 << bit % 8));
    Overwrite(work_ + name, content);
    SCOPED_TRACE(core::Message("bit ", bit, " of ", name));
    const bool opened = Compare();
    ++(opened ? harmless : refused)[name];
    if (!opened && salvages > 0) {
      --salvages;
      ++salvaged;
      finished += Salvage();
      Restore();
    } else {
      Overwrite(work_ + name, files_.at(name));
    }
  }
  for (const char* name : kFiles) {
    std::cout << name << ": " << refused[name] << " flips refused, " << harmless[name]
              << " without effect\n";
  }
  std::cout << salvaged << " salvaged, with " << finished << " of " << 3 * salvaged
            << " finished meshes\n";
  EXPECT_GT(refused[kFiles[0]] + refused[kFiles[1]], flips / 4);
  EXPECT_GE(finished, 2 * salvaged) << "a bit is in one mesh";
}

TEST_F(FlippedBits, SalvageLeavesASoundJournalAndAnotherVersionAlone) {
  MakePristine();
  const auto said = SalvageDataDir(work_);
  ASSERT_TRUE(said);
  EXPECT_NE(said->find("nothing was changed"), std::string::npos);
  EXPECT_NE(VerifyDataDir(work_)->find("3 finished meshes, 1 to go on"), std::string::npos);
  for (const auto& [name, content] : files_) EXPECT_TRUE(ContentOf(work_ + name) == content);
  EXPECT_FALSE(SalvageDataDir(work_ + "/none"));
  Overwrite(work_ + "/journal.sqlite", "a letter");
  fs::remove(work_ + "/journal.mark");
  EXPECT_FALSE(SalvageDataDir(work_)) << "it is no journal";
  EXPECT_EQ(ContentOf(work_ + "/journal.sqlite"), "a letter");
}

// All of it: the file's first page, and so SQLite's idea of what a database it is.
TEST_F(FlippedBits, SalvageDoesWithoutTheFirstPage) {
  MakePristine();
  std::string content = files_["/journal.sqlite"];
  content.replace(0, 4096, 4096, '\xff');
  Overwrite(work_ + "/journal.sqlite", content);
  EXPECT_FALSE(VerifyDataDir(work_));
  EXPECT_EQ(Salvage(), 3);
  EXPECT_TRUE(VerifyDataDir(work_));
}

}  // namespace
}  // namespace stellate::server
