#pragma once

#include "stellate/client.h"
#include "stellate/doctor.h"

namespace stellate::client {

// What ChooseEpsilon says of a Check that was made.
Expected<ChosenEpsilon> ChooseEpsilon(CheckReport report);

}  // namespace stellate::client
