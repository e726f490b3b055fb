#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stellate/oracle.h"

namespace stellate::testing {

// A ready oracle of each kind: those that tests/e2e/python/test_languages_agree.py makes, too.
// Throws std::invalid_argument for a name that is none.
std::unique_ptr<Oracle> MakeReadyOracle(const std::string& name);
std::vector<std::string> ReadyOracles();

}  // namespace stellate::testing
