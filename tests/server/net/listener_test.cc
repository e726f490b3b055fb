#include "server/net/listener.h"

#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <unistd.h>

#include <condition_variable>
#include <mutex>

#include "tests/server/support/loopback.h"

namespace stellate::server {
namespace {

using testing::ConnectTo;

constexpr int kMany = 8;

// Keeps what a listener hands over.
class Taken {
 public:
  ~Taken() {
    for (const int fd : fds_) close(fd);
  }
  Listener::Taker Take() {
    return [this](int, int fd) {
      const std::lock_guard lock(mutex_);
      fds_.push_back(fd);
      changed_.notify_all();
    };
  }
  void Await(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return fds_.size() >= count; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> fds_;
};

std::unique_ptr<Listener> OnLoopback(std::size_t max_connections) {
  auto listener = Listener::Open(*ParseListenAddress("127.0.0.1:0"), max_connections);
  EXPECT_TRUE(listener);
  return listener ? std::move(*listener) : nullptr;
}

// gRPC's own listener is deaf from then on.
TEST(Listener, GoesOnOnceThereAreFilesAgain) {
  {
    // UBSan opens files to look at a type for the first time: let it do so while there are any.
    const auto before = OnLoopback(100);
    Taken taken;
    before->Start(taken.Take(), [] {});
    const int client = ConnectTo(before->port());
    taken.Await(1);
    close(client);
  }
  const auto listener = OnLoopback(100);
  std::vector<int> clients;
  for (int i = 0; i < kMany; ++i) clients.push_back(ConnectTo(listener->port()));
  Taken taken;
  // The next descriptor but one is out of bounds; what Start itself needs is the next.
  rlimit old{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &old), 0);
  const int next = dup(0);
  close(next);
  rlimit few = old;
  few.rlim_cur = static_cast<rlim_t>(next) + 2;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  listener->Start(taken.Take(), [] {});
  taken.Await(1);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &old), 0);
  taken.Await(kMany);
  for (const int fd : clients) close(fd);
}

TEST(Listener, TellsOfEachConnectionThatIsOneTooMany) {
  const auto listener = OnLoopback(2);
  Taken taken;
  std::atomic<int> refused{0};
  listener->Start(taken.Take(), [&refused] { ++refused; });
  std::vector<int> clients;
  for (int i = 0; i < kMany; ++i) clients.push_back(ConnectTo(listener->port()));
  for (int i = 2; i < kMany; ++i) {
    char byte = 0;
    EXPECT_LE(recv(clients[static_cast<std::size_t>(i)], &byte, 1, 0), 0);
  }
  listener->Stop();
  EXPECT_EQ(refused, kMany - 2);
  for (const int fd : clients) close(fd);
}

// The kernel of the other side has acknowledged that nothing more will come.
void HangUp(int client) {
  ASSERT_EQ(shutdown(client, SHUT_WR), 0);
  tcp_info info{};
  do {
    socklen_t size = sizeof(info);
    ASSERT_EQ(getsockopt(client, IPPROTO_TCP, TCP_INFO, &info, &size), 0);
  } while (info.tcpi_state == TCP_FIN_WAIT1);
}

TEST(Listener, ClientsThatHungUpWhileTheyWaitedAreNotTaken) {
  const auto listener = OnLoopback(1);
  std::vector<int> clients;
  for (int i = 0; i < kMany; ++i) {
    clients.push_back(ConnectTo(listener->port()));
    HangUp(clients.back());
  }
  clients.push_back(ConnectTo(listener->port()));
  Taken taken;
  std::atomic<int> refused{0};
  listener->Start(taken.Take(), [&refused] { ++refused; });
  taken.Await(1);
  listener->Stop();
  EXPECT_EQ(refused, 0) << "the one that is there was the only one to be counted";
  for (const int fd : clients) close(fd);
}

TEST(Listener, ConnectionsWaitWhileTheyAreToldTo) {
  const auto listener = OnLoopback(kMany);
  std::atomic<int> asked{0};
  Taken taken;
  listener->Start(
      taken.Take(), [] {}, [&asked] { return ++asked <= 3; });
  const int client = ConnectTo(listener->port());
  taken.Await(1);
  listener->Stop();
  EXPECT_GT(asked, 3);
  close(client);
}

TEST(Listener, ListensOnEveryAddressOfAName) {
  auto listener = Listener::Open(*ParseListenAddress("localhost:0"), 4);
  ASSERT_TRUE(listener);
  EXPECT_GT((*listener)->port(), 0);
  Taken taken;
  (*listener)->Start(taken.Take(), [] {});
  const int client = ConnectTo((*listener)->port());
  taken.Await(1);
  close(client);
}

TEST(Listener, AddressesOfOthersAndTakenPortsAreRefused) {
  EXPECT_FALSE(Listener::Open(*ParseListenAddress("192.0.2.1:0"), 4));
  const auto listener = OnLoopback(4);
  const auto second =
      Listener::Open(*ParseListenAddress("127.0.0.1:" + std::to_string(listener->port())), 4);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("--listen"), std::string::npos);
}

}  // namespace
}  // namespace stellate::server
