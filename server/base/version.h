#pragma once

namespace stellate::server {

const char* Version();  // of this program, as `--version` says it

}  // namespace stellate::server
