#pragma once

#include "core/examiner.h"
#include "stellate/v1/doctor.pb.h"

namespace stellate::server {

// The words of oracles in them are made fit to be shown.
void ToProto(const core::Finding& finding, v1::Finding* out);
// With the report as text, and the epsilon that "auto" stands for.
void ToProto(const core::ExaminationReport& report, v1::CheckReport* out);

}  // namespace stellate::server
