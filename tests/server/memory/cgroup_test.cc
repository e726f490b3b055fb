#include "server/memory/cgroup.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "server/memory/machine.h"

namespace stellate::server {
namespace {

namespace fs = std::filesystem;

// A tree of files as a process sees them, below a directory of the test's own.
class CgroupTest : public ::testing::Test {
 protected:
  CgroupTest() : root_(::testing::TempDir() + "cgroup-" + std::to_string(getpid())) {
    fs::remove_all(root_);
  }
  ~CgroupTest() override { fs::remove_all(root_); }

  void Write(const std::string& path, const std::string& text) {
    fs::create_directories(fs::path(root_ + path).parent_path());
    std::ofstream(root_ + path) << text;
  }
  // What the kernel says of a process in `groups`, where `mounts` are.
  void Process(const std::string& groups, const std::string& mounts) {
    Write("/proc/self/cgroup", groups);
    Write("/proc/self/mountinfo",
          "22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw,errors=remount-ro\n" + mounts);
  }

  const std::string root_;
};

constexpr char kMountOf2[] =
    "30 22 0:26 / /sys/fs/cgroup rw,nosuid shared:9 - cgroup2 cgroup2 rw,nsdelegate\n";
constexpr char kMountOf1[] =
    "34 31 0:31 / /sys/fs/cgroup/cpu rw - cgroup cgroup rw,cpu\n"
    "35 31 0:32 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n";
constexpr char kNoLimitOf1[] = "9223372036854771712\n";

TEST_F(CgroupTest, NoneWithoutGroups) {
  EXPECT_EQ(CgroupMemoryLimit(root_), std::nullopt);
  Process("0::/\n", "");
  EXPECT_EQ(CgroupMemoryLimit(root_), std::nullopt);
  Process("0::/\nnonsense\n1\n:\n", std::string(kMountOf2) + "nonsense\n\n - cgroup2\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), std::nullopt);
}

TEST_F(CgroupTest, Version2OfAContainer) {
  Process("0::/\n", kMountOf2);
  Write("/sys/fs/cgroup/memory.max", "max\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), std::nullopt);
  Write("/sys/fs/cgroup/memory.max", "536870912\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 536870912u);
}

TEST_F(CgroupTest, Version2TakesTheLeastOfNestedGroups) {
  Process("0::/system.slice/stellate.slice/stellated.service\n", kMountOf2);
  const std::string slice = "/sys/fs/cgroup/system.slice";
  Write(slice + "/stellate.slice/stellated.service/memory.max", "3000\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 3000u);
  Write(slice + "/memory.max", "2000\n");
  Write(slice + "/stellate.slice/memory.max", "max\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 2000u) << "the group around the one around";
  Write(slice + "/stellate.slice/stellated.service/memory.max", "1000\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 1000u);
  Write("/sys/fs/cgroup/other.slice/memory.max", "1\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 1000u) << "another's group";
}

TEST_F(CgroupTest, Version1) {
  Process("4:memory:/user/stellate\n1:cpu:/\n0::/\n", kMountOf1);
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", kNoLimitOf1);
  Write("/sys/fs/cgroup/memory/user/stellate/memory.limit_in_bytes", "440401920\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 440401920u);
  Write("/sys/fs/cgroup/memory/user/memory.limit_in_bytes", "4096\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 4096u);
}

TEST_F(CgroupTest, Version1BesideAnEmptyVersion2) {
  Process("4:memory:/\n0::/init.scope\n",
          std::string(kMountOf1) +
              "41 31 0:38 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw\n");
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "440401920\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 440401920u);
}

// Docker with version 1: the path is the host's, while the mount shows the container's group alone.
TEST_F(CgroupTest, Version1OfAContainerThatKnowsItsPathOnTheHost) {
  Process("4:cpu,memory:/docker/0123abcd/nested\n",
          "35 31 0:32 /docker/0123abcd /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n");
  Write("/sys/fs/cgroup/memory/memory.limit_in_bytes", "2000\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 2000u);
  Write("/sys/fs/cgroup/memory/nested/memory.limit_in_bytes", "1000\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 1000u);
  Write("/sys/fs/cgroup/memory/memory.stat",
        "cache 12\nrss 4\nhierarchical_memory_limit 500\ntotal_cache 1\n");
  EXPECT_EQ(CgroupMemoryLimit(root_), 500u) << "of a group outside, which cannot be seen";
}

TEST_F(CgroupTest, ProcessorsWithoutAQuota) {
  EXPECT_EQ(CgroupProcessors(root_), std::nullopt);
  Process("0::/\n", kMountOf2);
  Write("/sys/fs/cgroup/cpu.max", "max 100000\n");
  EXPECT_EQ(CgroupProcessors(root_), std::nullopt);
  Process("4:memory:/\n1:cpu,cpuacct:/\n", kMountOf1);
  Write("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "-1\n");
  Write("/sys/fs/cgroup/cpu/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(CgroupProcessors(root_), std::nullopt);
}

TEST_F(CgroupTest, ProcessorsAreTheLeastOfNestedGroups) {
  Process("0::/kubepods.slice/pod.slice/server\n", kMountOf2);
  const std::string pods = "/sys/fs/cgroup/kubepods.slice";
  Write(pods + "/pod.slice/server/cpu.max", "max 100000\n");
  Write(pods + "/pod.slice/cpu.max", "150000 100000\n");
  EXPECT_EQ(CgroupProcessors(root_), 1.5);
  Write(pods + "/cpu.max", "50000 200000\n");
  EXPECT_EQ(CgroupProcessors(root_), 0.25);
}

TEST_F(CgroupTest, ProcessorsOfVersion1) {
  Process("4:memory:/\n1:cpu,cpuacct:/docker/0123\n", kMountOf1);
  Write("/sys/fs/cgroup/cpu/docker/0123/cpu.cfs_quota_us", "200000\n");
  Write("/sys/fs/cgroup/cpu/docker/0123/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(CgroupProcessors(root_), 2.0);
}

TEST(Machine, HasAProcessor) { EXPECT_GE(MachineProcessors(), 1u); }

}  // namespace
}  // namespace stellate::server
