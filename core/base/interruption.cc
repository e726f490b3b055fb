#include "core/base/interruption.h"

#include "core/base/pauses.h"
#include "core/base/task_group.h"

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task.h>
#endif

namespace stellate::core {

#if defined(__SANITIZE_THREAD__)
struct Interruption::Group {};

void Interruption::Raise() { raised_ = true; }

InterruptionCheck::InterruptionCheck() : group_(nullptr) {}
bool InterruptionCheck::operator()() const {
  PauseIfAsked();
  return false;
}
#else
void Interruption::Raise() {
  raised_ = true;
  group_->context.cancel_group_execution();
}

InterruptionCheck::InterruptionCheck() : group_(tbb::task::current_context()) {}

bool InterruptionCheck::operator()() const {
  PauseIfAsked();
  if (void (*const told)() = on_interruption_check.load(std::memory_order_relaxed)) told();
  return group_ != nullptr &&
         static_cast<tbb::task_group_context*>(group_)->is_group_execution_cancelled();
}
#endif

Interruption::Interruption() : group_(std::make_unique<Group>()) {}
Interruption::~Interruption() = default;

void ThrowIfInterrupted() {
  if (InterruptionCheck()()) throw Interrupted{};
}

}  // namespace stellate::core
