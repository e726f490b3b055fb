#pragma once

#include <string>
#include <string_view>

#include "stellate/error.h"

namespace stellate::client {

// Puts the bytes in the place of whatever was there, whole or not at all: what cannot be written to
// its end leaves the old file. kFileFailed, with the system's reason.
Expected<void> WriteFile(const std::string& path, std::string_view bytes);

// kFileFailed where WriteFile could not even begin.
Expected<void> CheckWrite(const std::string& path);

}  // namespace stellate::client
