#pragma once

#include <optional>

#include "stellate/client.h"
#include "stellate/doctor.h"

namespace stellate::client {

// What ChooseEpsilon says of a Check that was made.
Expected<ChosenEpsilon> ChooseEpsilon(CheckReport report);
// The next automatic epsilon after a mesh with this report; none: a smaller
// one would mend nothing.
std::optional<ChosenEpsilon> Finer(const Report& report);

}  // namespace stellate::client
