#pragma once

#include <filesystem>
#include <string>

namespace stellate::oracles::files {

// The bytes of a regular file. Throws std::invalid_argument.
std::string Contents(const std::filesystem::path& path);

// The ending of a file's name, in lower case, with its dot.
std::string EndingOf(const std::filesystem::path& path);

}  // namespace stellate::oracles::files
