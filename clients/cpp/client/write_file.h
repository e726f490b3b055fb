#pragma once

#include <string>
#include <string_view>

#include "stellate/error.h"

namespace stellate::client {

// Puts the bytes in the place of whatever was there. kFileFailed, with the system's reason.
Expected<void> WriteFile(const std::string& path, std::string_view bytes);

}  // namespace stellate::client
