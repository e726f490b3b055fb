#pragma once

#include <string>
#include <string_view>

#include "stellate/error.h"

namespace stellate::view {

// The viewer's page, one file of HTML that needs nothing else. kRefused: this build has none, and
// why.
Expected<std::string_view> Page();

// The page with a recording inside: it shows only that, and makes no connection. JSON,
// {"replies": [{"method": "WatchMesh", "frames": [base64 of each message]}, ...]}, a reply for each
// call that the page makes: WatchMesh, GetMesh, and DownloadMesh with its "revision".
Expected<std::string> PageWith(std::string_view recording);

}  // namespace stellate::view
