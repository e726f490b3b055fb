#include "core/parts/territory.h"

namespace stellate::core {

Territory::Territory() {
  static const Alone alone;
  peers_ = &alone;
}

}  // namespace stellate::core
