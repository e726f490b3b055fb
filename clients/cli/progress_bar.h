#pragma once

#include <cstdint>
#include <string>

#include "stellate/report.h"

namespace stellate::cli {

// Progress on standard error: a line that redraws itself on a terminal, silence elsewhere.
class ProgressBar {
 public:
  explicit ProgressBar(bool quiet);
  ~ProgressBar() { Clear(); }
  void Show(const Progress& progress);
  void ShowPart(std::uint64_t received, std::uint64_t all);  // of a mesh that is fetched
  void Clear();

 private:
  void Draw(const std::string& line);

  bool drawing_;
  bool shown_ = false;
};

// One line for `progress`, at most `width` columns.
std::string ProgressLine(const Progress& progress, int width);

}  // namespace stellate::cli
