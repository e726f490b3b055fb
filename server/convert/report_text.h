#pragma once

#include <string>
#include <vector>

#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// A report for people, which all clients show: an entry a line, "title  words", titles flush right
// in 13 columns, lines of at most 100 bytes (unless a word is longer), folded under their words.
// UTF-8 without control characters but '\n', whatever workers and oracles said. `report.text` is
// ignored.
//
// `k`: of the simplices. `names`: of the regions.
std::string ReportText(const v1::Report& report, int k, const std::vector<std::string>& names = {});

}  // namespace stellate::server
