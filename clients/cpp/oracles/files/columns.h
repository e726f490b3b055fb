#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace stellate::oracles::files {

// A title as it is meant, without the quotes that a CSV may have about it.
std::string_view Unquoted(std::string_view title);

// "time, x, y, z", at most a few.
std::string Listed(const std::vector<std::string_view>& titles);

// Returns which of `width` columns, from 0, has this title or, if none has, this number from 1.
// `titles`: of the columns; empty: they have none. Throws std::invalid_argument: there is none.
std::size_t FindColumn(const std::string& column, const std::vector<std::string_view>& titles,
                       std::size_t width);

}  // namespace stellate::oracles::files
