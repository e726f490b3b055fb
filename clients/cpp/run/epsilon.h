#pragma once

#include <optional>
#include <string>

#include "stellate/client.h"
#include "stellate/doctor.h"

namespace stellate::client {

// Adds to a report why the epsilon of its mesh was chosen, which the server does not know; empty:
// it was given.
void Tell(const std::string& epsilon_reason, Report* report);
// The next automatic epsilon after a mesh with this report; none: a smaller
// one would mend nothing.
std::optional<ChosenEpsilon> Finer(const Report& report);

}  // namespace stellate::client
