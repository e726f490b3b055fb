#pragma once

#include <string>

namespace stellate::server {

const char* Version();  // of this program

// The line of `--version`, which names the gRPC it runs on as well: advisories are about that.
std::string VersionLine();

}  // namespace stellate::server
