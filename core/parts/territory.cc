#include "core/parts/territory.h"

namespace stellate::core {

Territory::Territory() : peers_(&NoPeers()) {}

}  // namespace stellate::core
