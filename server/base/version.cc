#include "server/base/version.h"

namespace stellate::server {

const char* Version() { return STELLATE_VERSION; }

}  // namespace stellate::server
