#include "core/base/pauses.h"

namespace stellate::core {
namespace {

constinit thread_local const Pauses* innermost = nullptr;

}  // namespace

Pauses::Pauses(FunctionRef<void()> pause) : pause_(pause), outer_(innermost) { innermost = this; }

Pauses::~Pauses() { innermost = outer_; }

void PauseIfAsked() {
  if (innermost != nullptr) innermost->pause_();
}

}  // namespace stellate::core
