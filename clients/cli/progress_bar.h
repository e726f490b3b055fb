#pragma once

#include <string>

#include "stellate/report.h"

namespace stellate::cli {

// Progress on standard error: a line that redraws itself on a terminal, silence elsewhere.
class ProgressBar {
 public:
  explicit ProgressBar(bool quiet);
  ~ProgressBar() { Clear(); }
  void Show(const Progress& progress);
  void Clear();

 private:
  bool drawing_;
  bool shown_ = false;
};

// One line for `progress`, at most `width` columns.
std::string ProgressLine(const Progress& progress, int width);

}  // namespace stellate::cli
