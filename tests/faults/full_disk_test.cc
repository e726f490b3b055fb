// The disk of the journal fails at a random moment of a mesh: every write is refused, or the disk
// is full. The server lives on; what it had recorded it takes up again, and every mesh that comes
// to an end is bit for bit the undisturbed one.
//
// $STELLATE_DISK_FAULTS: how often (1, of each); $STELLATE_FAULT_SEED: of the moments (1).

#include <fcntl.h>
#include <sys/mount.h>

#include <iostream>

#include "server/journal/journal.h"
#include "tests/faults/fault_test.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::Bytes;
using testing::ExpectSame;
using testing::RawWorker;
using testing::Watch;

class FailingDisk : public testing::FaultTest {
 protected:
  // Meshes until the disk has failed `wanted` meshes. `fail` and `mend` act on the server that
  // runs.
  void Run(const std::function<void(testing::ServerProcess*)>& fail,
           const std::function<void(testing::ServerProcess*)>& mend) {
    const int wanted = testing::FromEnvironment("STELLATE_DISK_FAULTS", 1);
    auto server = Next();
    const std::optional<Bytes> undisturbed = Undisturbed(server->stub());
    ASSERT_TRUE(undisturbed);
    int failed = 0, resumed = 0, spared = 0;
    while (failed < wanted && !HasFailure()) {
      const std::string name = Create(server->stub());
      auto worker = std::make_unique<RawWorker>(server->stub(), name, Slowly);
      while (worker->chunks() == 0) std::this_thread::sleep_for(1ms);
      std::this_thread::sleep_for(Moment());
      fail(server.get());
      std::optional<Bytes> mesh = Watch(server->stub(), name);
      ASSERT_TRUE(mesh) << "the server did not live on";
      if (mesh->state == v1::MESH_STATE_SUCCEEDED) {  // it was over before
        ++spared;
        ExpectSame(*mesh, *undisturbed);
      } else {
        ++failed;
        EXPECT_EQ(mesh->state, v1::MESH_STATE_FAILED);
        EXPECT_TRUE(mesh->failure == "JOURNAL_FULL" || mesh->failure == "JOURNAL_FAILED")
            << mesh->failure;
      }
      const bool lost = mesh->state == v1::MESH_STATE_FAILED;
      if (failed % 2 == 0) {
        // The same server, once the disk is well again.
        mend(server.get());
        const std::optional<Bytes> next = Undisturbed(server->stub());
        ASSERT_TRUE(next);
        ExpectSame(*next, *undisturbed);
      }
      server->Kill();
      mend(nullptr);
      server = Next();
      // Its end is on record, or it goes on where the record ends.
      worker = std::make_unique<RawWorker>(server->stub(), name, Slowly);
      mesh = Watch(server->stub(), name);
      ASSERT_TRUE(mesh);
      if (lost && mesh->state == v1::MESH_STATE_FAILED) continue;
      ExpectSame(*mesh, *undisturbed);
      if (lost) ++resumed;
    }
    std::cout << failed << " meshes met a failing disk, " << resumed
              << " of them went on with the next server; " << spared << " were over before\n";
  }
};

// A small file system in memory, where the program may mount one.
class SmallDisk {
 public:
  SmallDisk(const std::string& path, const char* size) : path_(path) {
    std::filesystem::create_directories(path);
    mounted_ = mount("stellate", path.c_str(), "tmpfs", 0, size) == 0;
  }
  ~SmallDisk() {
    if (mounted_) {
      EXPECT_EQ(umount2(path_.c_str(), MNT_DETACH), 0);
    }
  }
  bool mounted() const { return mounted_; }
  static constexpr char kMissing[] = "SKIPPED: needs the right to mount a small file system";

 private:
  const std::string path_;
  bool mounted_ = false;
};

// Fills it.
void Drop(const std::string& ballast) {
  const int file = open(ballast.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
  const std::string block(4096, 'x');
  while (write(file, block.data(), block.size()) > 0) {
  }
  close(file);
}

TEST_F(FailingDisk, RefusedWritesHarmNothingElse) {
  Run([](testing::ServerProcess* server) { server->process().LimitFiles(0); },
      [](testing::ServerProcess* server) {
        if (server != nullptr) server->process().LimitFiles(RLIM_INFINITY);
      });
}

TEST_F(FailingDisk, AFullDiskHarmsNothingElse) {
  data_ = directory_ + "/disk";
  const SmallDisk disk(data_, "size=64m");
  if (!disk.mounted()) GTEST_SKIP() << SmallDisk::kMissing;
  const std::string ballast = data_ + "/ballast";
  Run([&](testing::ServerProcess*) { Drop(ballast); },
      [&](testing::ServerProcess*) { std::filesystem::remove(ballast); });
}

std::shared_ptr<SessionJournal> Begin(Journal* journal) {
  const auto mesh = journal->NewMesh();
  SessionOptions options;
  options.request.name = "meshes/0123456789abcdef0123456789abcdef";
  options.request.spec = testing::SphereSpec(0.1);
  EXPECT_FALSE(mesh->WriteStart(options.request, {}));
  return mesh;
}

// A mesh too large to be removed in one piece, and not a byte left to say so.
TEST_F(FailingDisk, ADeletionMakesRoomOnAFullDisk) {
  data_ = directory_ + "/disk";
  const SmallDisk disk(data_, "size=48m");
  if (!disk.mounted()) GTEST_SKIP() << SmallDisk::kMissing;
  core::QueryBatch batch;
  batch.blocks.resize(1);
  batch.blocks[0].points = Eigen::MatrixXd::Random(3, 50'000);
  const core::Answers answers = EmptyAnswers(2, batch);
  {
    const auto journal = Journal::Open({data_});
    ASSERT_TRUE(journal) << journal.error().message;
    const auto mesh = Begin(journal->get());
    std::optional<MeshFailure> failure;
    while (!failure) {
      ++batch.round;
      mesh->BeginRound(batch);
      failure = mesh->WriteRound(batch, answers, {});
    }
    EXPECT_EQ(failure->reason, FailureReason::kJournalFull);
    EXPECT_GT(batch.round, 10u) << "12 MB, of which 8 are removed at once";
    Drop(data_ + "/ballast");
    mesh->Forget();
  }
  EXPECT_LT(std::filesystem::file_size(data_ + "/journal.sqlite"), 1'000'000u);
  const auto journal = Journal::Open({data_});
  ASSERT_TRUE(journal) << journal.error().message;
  EXPECT_TRUE((*journal)->TakeMeshes().empty());
  const auto mesh = Begin(journal->get());
  batch.round = 1;
  mesh->BeginRound(batch);
  EXPECT_FALSE(mesh->WriteRound(batch, answers, {})) << "there is room again";
}

}  // namespace
}  // namespace stellate::server
