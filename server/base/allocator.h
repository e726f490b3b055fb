#pragma once

namespace stellate::server {

// Has the C library give large blocks back to the system as they are freed. By itself it learns to
// keep blocks of up to 32 MB, and the arrays of a growing mesh leave behind a fifth of what it
// needs. Call it before there are threads.
void GiveBackLargeBlocks();

}  // namespace stellate::server
