#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace stellate::server {

// An end for HTTP/2 header blocks. gRPC before 1.53.2 (1.54.3, 1.55.2, 1.56.2) takes blocks of any
// length, keeps a string in them until it is whole, and copies all of it again with each frame: two
// clients at 3 Mbit/s each stop a server for all clients (CVE-2023-33953). No call is open
// meanwhile, so nothing that counts calls sees it. In such a gRPC, where it is a shared library,
// this replaces three functions of its header parser by ones of the same name, which the program's
// own come before; they count, and call gRPC's. gRPC 1.56.2, as packaging/grpc/build makes it, has
// an end of its own for strings; it is held to the same bounds, by the functions that it is patched
// to call.
//
// Of clients, in every server of this process: a header block has at most kMostHeaderBytes on the
// wire in kMostHeaderFrames frames, and its headers at most kMostMetadataBytes, also before the
// client has acknowledged that bound. A connection with a longer one is closed.
inline constexpr std::uint32_t kMostMetadataBytes = 8 << 10;  // gRPC's own, once acknowledged
inline constexpr std::uint32_t kMostHeaderBytes = 16 << 10;   // base64 and Huffman's worst within
inline constexpr std::uint32_t kMostHeaderFrames = 8;         // two hold as many bytes

// False: blocks of any length would be taken, as by this gRPC and the way the program was built.
bool HeaderBlocksEnd();

// Whether a block may go on after so much. Counts it where it may not.
bool HeaderBlockFits(std::size_t bytes, std::size_t frames);

// How many connections were closed for it since the process began.
std::uint64_t EndlessHeaderBlocks();

// Whether gRPC of that version, "1.51.1", needs all this.
bool LacksHeaderBound(std::string_view version);

}  // namespace stellate::server
