#include "top_command.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "stellate/monitor.h"

namespace stellate::cli {
namespace {

constexpr const char* kDefaultServer = "127.0.0.1:7717";

struct Size {
  int columns = 0, lines = 0;  // 0: no limit
};

// Where the frames go: redrawn in place on a terminal, one after another elsewhere.
class Screen {
 public:
  explicit Screen(bool live) : live_(live) {
    if (live_) std::fputs("\033[?1049h\033[?25l", stdout);  // a page of its own, no cursor
  }
  ~Screen() {
    if (live_) std::fputs("\033[?25h\033[?1049l", stdout);
    std::fflush(stdout);
  }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  // Asked for each frame, so that it follows a window that is resized.
  Size size() const {
    winsize window{};
    if (!live_ || ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) != 0 || window.ws_col == 0) return {};
    return {window.ws_col, window.ws_row};
  }

  void Show(const std::vector<std::string>& lines) {
    if (live_) std::fputs("\033[H", stdout);
    for (size_t i = 0; i < lines.size(); ++i) {
      std::fputs(lines[i].c_str(), stdout);
      // No line end after the last: it would scroll a full page.
      std::fputs(live_ ? (i + 1 < lines.size() ? "\033[K\n" : "\033[K\033[J") : "\n", stdout);
    }
    std::fflush(stdout);
  }

 private:
  const bool live_;
};

// Returns false when the wait was cut short.
bool Wait(double seconds, const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  wake.wait_for(lock, stop, std::chrono::duration<double>(seconds),
                [&stop] { return stop.stop_requested(); });
  return !stop.stop_requested();
}

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

TopCommand::TopCommand(CLI::App& parent)
    : command_(parent.add_subcommand("top", "Show a server's meshes, live")),
      server_(command_, kDefaultServer) {
  const std::map<std::string, TopOrder> orders = {{"state", TopOrder::kState},
                                                  {"age", TopOrder::kAge},
                                                  {"vertices", TopOrder::kVertices},
                                                  {"rate", TopOrder::kRate},
                                                  {"label", TopOrder::kLabel}};
  command_->add_option("--sort", order_, "by state, age, vertices, rate or label")
      ->transform(CLI::CheckedTransformer(orders, CLI::ignore_case).description(""))
      ->default_str("state");
  command_->add_option("--interval", interval_, "seconds between looks")
      ->check(CLI::Range(0.1, 3600.0).description(""))
      ->capture_default_str();
  command_->add_flag("--once", once_, "print one table and exit");
  command_->footer("Ctrl-C ends it. Exit status: 0 done, 2 usage or refused, 3 no server.");
}

int TopCommand::Run(const std::stop_token& stop) const {
  const Expected<Connection> connection = server_.Read();
  if (!connection) return PrintError(connection.error());
  Expected<Monitor> monitor = Monitor::Connect(*connection);
  if (!monitor) return PrintError(monitor.error());
  Expected<ServerHealth> health = monitor->Health();
  if (!health) return PrintError(health.error());

  Screen screen(!once_ && isatty(STDOUT_FILENO) == 1);
  TopTable table(order_);
  do {
    const Size size = screen.size();
    std::vector<std::string> lines = {"stellated " + health->version + " at " + server_.address()};
    Expected<std::vector<MeshStatus>> meshes = monitor->Meshes();
    if (!meshes) {
      if (once_ || meshes.error().code == ErrorCode::kRefused) return PrintError(meshes.error());
      lines[0] += " does not answer: " + meshes.error().message;
    } else {
      table.Update(std::move(*meshes), Seconds());
      if (const auto now = monitor->Health(); now) health = now;
      if (!health->serving) lines[0] += ", stopping";
    }
    if (size.columns > 0) lines[0] = Tame(lines[0], static_cast<size_t>(size.columns));
    for (std::string& line : table.Lines(size.columns, size.lines > 0 ? size.lines - 1 : 0)) {
      lines.push_back(std::move(line));
    }
    screen.Show(lines);
  } while (!once_ && Wait(interval_, stop));
  return kExitCertified;
}

}  // namespace stellate::cli
