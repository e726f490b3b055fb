#include "core/execution.h"

#include "core/base/message.h"
#include "core/field_status.h"

namespace stellate::core {

Status Validate(const Execution& execution) {
  if (execution.threads >= 0) return Status::Ok();
  return Invalid("threads", Message("threads is ", execution.threads,
                                    " but must not be negative: 0 takes all cores"));
}

}  // namespace stellate::core
