#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stellate/monitor.h"

namespace stellate::cli {

enum class TopOrder { kState, kAge, kVertices, kRate, kLabel };

// What `stellate top` shows: the meshes of one moment, and their speed since the moment before.
class TopTable {
 public:
  explicit TopTable(TopOrder order) : order_(order) {}

  // `now`: seconds on any clock that only goes forward.
  void Update(std::vector<MeshStatus> meshes, double now);

  // A line of totals, the column titles, and a line a mesh. Each at most `width` columns wide; at
  // most `height` lines; the last line counts the meshes that do not fit. 0: no limit.
  std::vector<std::string> Lines(int width, int height) const;

 private:
  struct Row {
    MeshStatus mesh;
    double rate = 0;  // vertices a second
  };
  struct Seen {
    std::uint64_t vertices = 0;
    double at = 0;
  };
  const TopOrder order_;
  std::vector<Row> rows_;
  std::map<std::string, Seen> seen_;  // by name, a moment ago
};

// Text of strangers made safe for a terminal (text/printable.h), of `columns` code points at most.
std::string Tame(const std::string& text, size_t columns);

// "4.2s", "3m12s", "5h07m"; "-" for nothing.
std::string ShortTime(double seconds);

}  // namespace stellate::cli
