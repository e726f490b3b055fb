#include "top_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include "text/printable.h"

namespace stellate::cli {
namespace {

constexpr size_t kLeastLabel = 8;
constexpr size_t kIdDigits = 8;  // of a mesh's name: enough to tell meshes apart, not to open one

struct Column {
  const char* title;
  int width;  // negative: flush left
};
constexpr Column kColumns[] = {{"STATE", -9},     {"PHASE", -10}, {"ROUND", 6},   {"VERTICES", 10},
                               {"SIMPLICES", 10}, {"VERT/S", 9},  {"WORKERS", 7}, {"WATCHERS", 8},
                               {"ELAPSED", 8},    {"LEFT", 8}};

std::string Cell(const std::string& text, int width) {
  const size_t columns = static_cast<size_t>(std::abs(width));
  const std::string gap(columns > text.size() ? columns - text.size() : 0, ' ');
  std::string cell(1, ' ');
  cell += width < 0 ? text + gap : gap + text;
  return cell;
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f", value);
  return text;
}

size_t CodePoints(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0) != 0x80;
  }));
}

std::string LowerPhase(Phase phase) {
  std::string name = PhaseName(phase);
  std::transform(name.begin(), name.end(), name.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return name;
}

// Under which name people know it.
std::string Title(const MeshStatus& mesh) {
  const size_t slash = mesh.name.find('/');
  const std::string id = mesh.name.substr(slash == std::string::npos ? 0 : slash + 1, kIdDigits);
  const std::string whose = mesh.owner.empty() ? "" : " of " + mesh.owner;
  return id + (mesh.label.empty() ? "" : " " + mesh.label) + whose;
}

std::string Cells(const MeshStatus& mesh, double rate) {
  const Progress& p = mesh.progress;
  const std::string values[] = {
      MeshStateName(mesh.state),    mesh.over() ? "-" : LowerPhase(p.phase),
      std::to_string(p.round),      std::to_string(p.vertices),
      std::to_string(p.simplices),  mesh.over() ? "-" : Number(rate),
      std::to_string(mesh.workers), std::to_string(mesh.watchers),
      ShortTime(p.elapsed_seconds), mesh.over() ? "-" : ShortTime(p.remaining_seconds)};
  std::string line;
  for (size_t i = 0; i < std::size(kColumns); ++i) line += Cell(values[i], kColumns[i].width);
  return line;
}

std::string Cut(const std::string& line, int width) {
  return width > 0 ? Tame(line, static_cast<size_t>(width)) : line;
}

std::string Counted(size_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : noun.back() == 'h' ? "es" : "s");
}

}  // namespace

std::string Tame(const std::string& text, size_t columns) {
  std::string tame = text::Printable(text, '?');
  size_t points = 0, end = 0;
  for (; end < tame.size(); ++end) {
    const bool continues = (static_cast<unsigned char>(tame[end]) & 0xC0) == 0x80;
    if (!continues && ++points > columns) break;
  }
  tame.resize(end);
  return tame;
}

std::string ShortTime(double seconds) {
  if (!(seconds > 0) || !std::isfinite(seconds)) return "-";
  char text[32];
  const long whole = std::lround(seconds);
  if (seconds < 59.95) {
    std::snprintf(text, sizeof text, "%.1fs", seconds);
  } else if (whole < 3600) {
    std::snprintf(text, sizeof text, "%ldm%02lds", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%ldh%02ldm", whole / 3600, whole / 60 % 60);
  }
  return text;
}

void TopTable::Update(std::vector<MeshStatus> meshes, double now) {
  std::map<std::string, Seen> seen;
  rows_.clear();
  for (MeshStatus& mesh : meshes) {
    const std::uint64_t vertices = mesh.progress.vertices;
    Row row;
    const auto before = seen_.find(mesh.name);
    if (before != seen_.end() && now > before->second.at) {
      const double grown =
          static_cast<double>(vertices) - static_cast<double>(before->second.vertices);
      row.rate = std::max(0.0, grown) / (now - before->second.at);
    } else if (mesh.progress.elapsed_seconds > 0) {
      row.rate = static_cast<double>(vertices) / mesh.progress.elapsed_seconds;
    }
    seen[mesh.name] = {vertices, now};
    row.mesh = std::move(mesh);
    rows_.push_back(std::move(row));
  }
  seen_ = std::move(seen);
  const auto key = [this](const Row& row) {
    const Progress& p = row.mesh.progress;
    const double age = -p.elapsed_seconds;
    switch (order_) {
      case TopOrder::kAge:
        return std::tuple(age, 0.0, std::string());
      case TopOrder::kVertices:
        return std::tuple(-static_cast<double>(p.vertices), age, std::string());
      case TopOrder::kRate:
        return std::tuple(row.mesh.over() ? 1.0 : -row.rate, age, std::string());
      case TopOrder::kLabel:
        return std::tuple(0.0, 0.0, row.mesh.label);
      case TopOrder::kState:
        break;
    }
    // What runs comes first, then what waits, then what is over.
    const double state = row.mesh.state == MeshState::kRunning ? 0 : row.mesh.over() ? 2 : 1;
    return std::tuple(state, age, std::string());
  };
  std::stable_sort(rows_.begin(), rows_.end(),
                   [&key](const Row& a, const Row& b) { return key(a) < key(b); });
}

std::vector<std::string> TopTable::Lines(int width, int height) const {
  size_t running = 0, waiting = 0, title = kLeastLabel;
  std::uint64_t workers = 0, watchers = 0, vertices = 0;
  for (const Row& row : rows_) {
    running += row.mesh.state == MeshState::kRunning;
    waiting += row.mesh.state == MeshState::kWaiting;
    workers += row.mesh.workers;
    watchers += row.mesh.watchers;
    vertices += row.mesh.progress.vertices;
    title = std::max(title, CodePoints(Title(row.mesh)));
  }
  int cells = 0;
  for (const Column& column : kColumns) cells += 1 + std::abs(column.width);
  if (width > 0) {
    const int room = width - cells;
    title = std::min(title, static_cast<size_t>(std::max<int>(kLeastLabel, room)));
  }
  std::vector<std::string> lines;
  lines.push_back(Cut(Counted(rows_.size(), "mesh") + ": " + std::to_string(running) +
                          " running, " + std::to_string(waiting) + " waiting; " +
                          Counted(workers, "worker") + ", " + Counted(watchers, "watcher") + "; " +
                          std::to_string(vertices) + " vertices",
                      width));
  std::string titles = "MESH" + std::string(title - 4, ' ');
  for (const Column& column : kColumns) titles += Cell(column.title, column.width);
  lines.push_back(Cut(titles, width));
  const size_t fit = height > 0 ? static_cast<size_t>(std::max(0, height - 2)) : rows_.size();
  const size_t shown = rows_.size() > fit ? (fit > 0 ? fit - 1 : 0) : rows_.size();
  for (size_t i = 0; i < shown; ++i) {
    std::string name = Tame(Title(rows_[i].mesh), title);
    name += std::string(title - CodePoints(name), ' ');
    lines.push_back(Cut(name + Cells(rows_[i].mesh, rows_[i].rate), width));
  }
  if (shown < rows_.size() && fit > 0) {
    lines.push_back(Cut("... and " + std::to_string(rows_.size() - shown) + " more", width));
  }
  return lines;
}

}  // namespace stellate::cli
