#include <atomic>
#include <cstdio>
#include <thread>
#include <utility>
#include <vector>

#include "tests/load/load.h"
#include "tests/load/server_process.h"

namespace stellate::load {
namespace {

// What the memory may grow by from the middle of a soak to its end, however long it is, by the line
// that fits it best. Meshes come and go in it, so that single samples are some 20 MB apart.
constexpr double kMostGrowthMb = 16;
constexpr double kShortestJudged = 120;  // seconds: before that, kept meshes are still filling up

struct Sample {
  double seconds = 0, resident_mb = 0;
};

// Least squares, in MB a second.
double Slope(const std::vector<Sample>& samples) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const Sample& sample : samples) {
    n += 1;
    x += sample.seconds;
    y += sample.resident_mb;
    xx += sample.seconds * sample.seconds;
    xy += sample.seconds * sample.resident_mb;
  }
  const double spread = n * xx - x * x;
  return spread > 0 ? (n * xy - x * y) / spread : 0;
}

}  // namespace

Mesh MeshOn(const std::string& server, const std::string& manifold, double epsilon, int workers) {
  const auto oracle = Make(manifold);
  MeshOptions options;
  options.epsilon = epsilon;
  options.connection.server = server;
  options.workers = workers;
  auto mesh = MeshManifold(*oracle, options);
  if (!mesh) Die(manifold + ": " + mesh.error().message);
  return std::move(*mesh);
}

bool AreIdentical(const Mesh& a, const Mesh& b) {
  return a.points.cols() == b.points.cols() && a.points == b.points &&
         a.simplices.cols() == b.simplices.cols() && a.simplices == b.simplices;
}

int Soak(double seconds) {
  ServerProcess server;
  const std::vector<std::pair<const char*, double>> kinds{
      {"torus", 0.1}, {"sphere", 0.1}, {"so3", 0.5}, {"torus@20", 0.15}};
  std::atomic<long> meshes{0}, different{0};
  std::vector<std::jthread> clients;
  const Stopwatch watch;
  for (const auto& [manifold, epsilon] : kinds) {
    clients.emplace_back([&, manifold = manifold, epsilon = epsilon](std::stop_token stop) {
      const Mesh reference = MeshOn(server.address(), manifold, epsilon, 1);
      while (!stop.stop_requested()) {
        const Mesh mesh = MeshOn(server.address(), manifold, epsilon, 1 + meshes % 3);
        ++meshes;
        if (!AreIdentical(mesh, reference)) ++different;
      }
    });
  }
  std::vector<Sample> samples;
  while (watch.seconds() < seconds) {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    samples.push_back({watch.seconds(), server.usage().resident_mb});
  }
  for (auto& client : clients) client.request_stop();
  clients.clear();
  // Kept meshes and arenas fill up at first.
  const std::vector<Sample> later(samples.begin() + static_cast<long>(samples.size() / 2),
                                  samples.end());
  std::printf("%ld meshes in %.0f s, %ld of them different from the first of their kind\n",
              meshes.load(), seconds, different.load());
  std::printf("  resident memory, MB:");
  for (int i = 0; i <= 10; ++i) {
    const std::size_t at = (samples.size() - 1) * static_cast<std::size_t>(i) / 10;
    std::printf(" %.0f", samples[at].resident_mb);
  }
  const double growth = Slope(later) * seconds / 2;
  std::printf("\n  growth over the second half: %+.1f MB; at most %.0f MB is allowed%s\n", growth,
              kMostGrowthMb, seconds < kShortestJudged ? ", and not judged: too short" : "");
  const bool flat = growth <= kMostGrowthMb || seconds < kShortestJudged;
  if (!flat) std::printf("  the memory is NOT FLAT\n");
  const int status = server.Stop();
  if (status != 0) std::printf("  the server left with %d\n", status);
  return different == 0 && flat && status == 0 ? 0 : 1;
}

}  // namespace stellate::load
