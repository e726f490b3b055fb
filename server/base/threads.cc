#include "server/base/threads.h"

#include <algorithm>
#include <latch>
#include <system_error>
#include <thread>
#include <vector>

#include "core/base/message.h"

namespace stellate::server {

std::size_t LeastThreads() {
  constexpr std::size_t kFew = 24, kMostProcessors = 16;
  return kFew + 2 * std::min<std::size_t>(std::thread::hardware_concurrency(), kMostProcessors);
}

core::Status CheckThreads(std::size_t count) {
  std::latch all(1);  // outlives the threads, which are joined as they are destroyed
  std::vector<std::jthread> threads;
  threads.reserve(count);
  bool refused = false;
  try {
    while (threads.size() < count) threads.emplace_back([&all] { all.wait(); });
  } catch (const std::system_error&) {
    refused = true;
  }
  all.count_down();
  if (!refused) return core::Status::Ok();
  return {core::StatusCode::kFailedPrecondition,
          core::Message("the system lets this process have ", threads.size(),
                        " more threads, but a server needs ", count,
                        " to start with: raise the limit on processes (ulimit -u, TasksMax, the "
                        "pids of the control group) or on memory (ulimit -v)")};
}

}  // namespace stellate::server
