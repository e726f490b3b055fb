#pragma once

#include "stellate/doctor.h"
#include "stellate/v1/doctor.pb.h"

namespace stellate::client {

CheckReport ReadCheckReport(const v1::CheckReport& message);

// Adds an error that only the client sees, unless there is one of its kind: then no epsilon will
// do.
void Add(Finding error, CheckReport* report);

}  // namespace stellate::client
