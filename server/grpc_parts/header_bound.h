#pragma once

#include <cstdint>
#include <string_view>

namespace stellate::server {

// An end for HTTP/2 header blocks. gRPC before 1.53.2 (1.54.3, 1.55.2, 1.56.2) takes blocks of any
// length, keeps a string in them until it is whole, and copies all of it again with each frame: two
// clients at 3 Mbit/s each stop a server for all clients (CVE-2023-33953). No call is open
// meanwhile, so nothing that counts calls sees it. In such a gRPC, where it is a shared library,
// this replaces three functions of its header parser by ones of the same name, which the program's
// own come before; they count, and call gRPC's. Delete it when no such gRPC is supported any more.
//
// Of clients, in every server of this process: a header block has at most kMostHeaderBytes on the
// wire in kMostHeaderFrames frames, and its headers at most kMostMetadataBytes, also before the
// client has acknowledged that bound. A connection with a longer one is closed.
inline constexpr std::uint32_t kMostMetadataBytes = 8 << 10;  // gRPC's own, once acknowledged
inline constexpr std::uint32_t kMostHeaderBytes = 16 << 10;   // base64 and Huffman's worst within
inline constexpr std::uint32_t kMostHeaderFrames = 8;         // two hold as many bytes

// False: blocks of any length would be taken, as by this gRPC and the way the program was built.
bool HeaderBlocksEnd();

// How many connections were closed for it since the process began.
std::uint64_t EndlessHeaderBlocks();

// Whether gRPC of that version, "1.51.1", needs all this.
bool LacksHeaderBound(std::string_view version);

}  // namespace stellate::server
