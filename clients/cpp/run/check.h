#pragma once

#include "run/host.h"
#include "stellate/doctor.h"
#include "stellate/error.h"
#include "stellate/oracle.h"

namespace stellate::client {

// Check, and ChooseEpsilon, on a server that was found; options.connection is not used.
Expected<CheckReport> CheckOn(const Host& host, Oracle& oracle, const CheckOptions& options);
Expected<ChosenEpsilon> ChooseEpsilonOn(const Host& host, Oracle& oracle,
                                        const CheckOptions& options);

}  // namespace stellate::client
