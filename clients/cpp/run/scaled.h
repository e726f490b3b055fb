#pragma once

#include <memory>

#include "stellate/client.h"

namespace stellate::client {

// The oracle that `options.scale` asks for: the one that is given, or that one in other units,
// which refers to it. kRefused.
Expected<std::shared_ptr<Oracle>> Scaled(Oracle& oracle, const MeshOptions& options);

}  // namespace stellate::client
