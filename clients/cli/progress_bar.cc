#include "progress_bar.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace stellate::cli {
namespace {

constexpr int kBarWidth = 24;

int TerminalWidth() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  return 80;
}

// What is being worked on, in a word or two.
std::string Doing(const Progress& p) {
  switch (p.phase) {
    case Phase::kSeeding:
      return "seeding";
    case Phase::kCertifying:
      return "certifying";
    case Phase::kDone:
      return "done";
    default:
      break;
  }
  if (p.unbounded_stars > 0) return "covering";
  if (p.bad_size + p.bad_radius_edge > 0) return "refining";
  return "agreeing";
}

std::string Bar(double fraction) {
  const double share = std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0;
  const int filled = static_cast<int>(std::lround(share * kBarWidth));
  char bar[64];
  std::snprintf(bar, sizeof bar, "[%s%s] %3d %%",
                std::string(static_cast<size_t>(filled), '#').c_str(),
                std::string(static_cast<size_t>(kBarWidth - filled), '.').c_str(),
                static_cast<int>(share * 100));
  return bar;
}

}  // namespace

std::string ProgressLine(const Progress& p, int width) {
  char line[256];
  std::snprintf(line, sizeof line, "%s  %-10s  %llu vertices, round %llu, %.1f s",
                Bar(p.fraction).c_str(), Doing(p).c_str(),
                static_cast<unsigned long long>(p.vertices),
                static_cast<unsigned long long>(p.round), p.elapsed_seconds);
  return std::string(line).substr(0, static_cast<size_t>(std::max(1, width)));
}

ProgressBar::ProgressBar(bool quiet) : drawing_(!quiet && isatty(STDERR_FILENO) == 1) {}

void ProgressBar::Show(const Progress& progress) {
  // One column short of the edge, where some terminals wrap.
  if (drawing_) Draw(ProgressLine(progress, TerminalWidth() - 1));
}

void ProgressBar::ShowPart(std::uint64_t received, std::uint64_t all) {
  if (!drawing_) return;
  const double share = all > 0 ? static_cast<double>(received) / static_cast<double>(all) : 1;
  const std::string line =
      Bar(share) + "  " + std::to_string(received) + " of " + std::to_string(all) + " fetched";
  Draw(line.substr(0, static_cast<size_t>(std::max(1, TerminalWidth() - 1))));
}

void ProgressBar::Draw(const std::string& line) {
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
  std::fflush(stderr);
  shown_ = true;
}

void ProgressBar::Clear() {
  if (!shown_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace stellate::cli
