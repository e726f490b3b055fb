#include "server/metrics/process_metrics.h"

#include <grpcpp/grpcpp.h>
#include <prometheus/metric_family.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include "server/base/version.h"
#include "server/memory/machine.h"

namespace stellate::server {
namespace {

using prometheus::MetricFamily;
using prometheus::MetricType;

constexpr double kNanosecond = 1e-9;

struct Stat {
  double threads = 0, virtual_bytes = 0;
  double start_seconds = 0;  // after the machine's start
};

// proc(5): the fields after the program's name, which may hold anything but ends with the last ')'.
std::optional<Stat> ReadStat() {
  std::ifstream file("/proc/self/stat");
  std::string line;
  if (!std::getline(file, line) || line.rfind(')') == std::string::npos) return {};
  std::istringstream fields(line.substr(line.rfind(')') + 1));
  std::string field;
  Stat stat;
  constexpr int kThreads = 20, kStart = 22, kVirtual = 23;
  for (int number = 3; number <= kVirtual; ++number) {
    if (!(fields >> field)) return {};
    const double value = number > 3 ? std::stod(field) : 0;  // the third is a letter
    if (number == kThreads) stat.threads = value;
    if (number == kStart) stat.start_seconds = value / static_cast<double>(sysconf(_SC_CLK_TCK));
    if (number == kVirtual) stat.virtual_bytes = value;
  }
  return stat;
}

// When the machine started, in seconds since 1970.
std::optional<double> BootSeconds() {
  std::ifstream file("/proc/stat");
  for (std::string word; file >> word;) {
    double seconds = 0;
    if (word == "btime" && file >> seconds) return seconds;
  }
  return {};
}

std::optional<double> ProcessorSeconds() {
  timespec used{};
  if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used) != 0) return {};
  return static_cast<double>(used.tv_sec) + kNanosecond * static_cast<double>(used.tv_nsec);
}

std::optional<double> OpenFiles() {
  std::error_code error;
  double count = 0;
  for (std::filesystem::directory_iterator file("/proc/self/fd", error), end; !error && file != end;
       file.increment(error)) {
    ++count;
  }
  if (error) return {};
  return count - 1;  // the directory itself
}

std::optional<double> MostFiles() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return {};
  return static_cast<double>(limit.rlim_cur);
}

void Add(std::vector<MetricFamily>* families, MetricType type, const char* name, const char* help,
         std::optional<double> value) {
  if (!value) return;
  prometheus::ClientMetric metric;
  (type == MetricType::Counter ? metric.counter.value : metric.gauge.value) = *value;
  families->push_back({name, help, type, {std::move(metric)}});
}

MetricFamily BuildInfo() {
  prometheus::ClientMetric metric;
  metric.label = {{"version", Version()}, {"grpc", grpc::Version()}, {"compiler", __VERSION__}};
  metric.gauge.value = 1;
  return {"stellate_build_info",
          "1; the labels say what this server is built of",
          MetricType::Gauge,
          {std::move(metric)}};
}

}  // namespace

std::vector<MetricFamily> ProcessMetrics::Collect() const {
  std::vector<MetricFamily> all = {BuildInfo()};
  Add(&all, MetricType::Counter, "process_cpu_seconds_total",
      "Time of processors that the process has used", ProcessorSeconds());
  Add(&all, MetricType::Gauge, "process_open_fds", "Files and connections that are open",
      OpenFiles());
  Add(&all, MetricType::Gauge, "process_max_fds", "As many may be open", MostFiles());
  Add(&all, MetricType::Gauge, "process_resident_memory_bytes", "Memory of the process",
      static_cast<double>(ResidentBytes()));
  if (const auto stat = ReadStat()) {
    Add(&all, MetricType::Gauge, "process_virtual_memory_bytes", "Its address space",
        stat->virtual_bytes);
    Add(&all, MetricType::Gauge, "process_threads", "Its threads", stat->threads);
    if (const auto boot = BootSeconds()) {
      Add(&all, MetricType::Gauge, "process_start_time_seconds",
          "When it started, in seconds since 1970", *boot + stat->start_seconds);
    }
  }
  return all;
}

}  // namespace stellate::server
