#pragma once

namespace stellate::server {

// From now on what gRPC and Protocol Buffers have to say goes through the server's log, in its
// format. Strangers can make them complain with every message, so no more than ten lines a second
// are let through; the number of those left out follows.
void TakeLibraryLogs();

}  // namespace stellate::server
