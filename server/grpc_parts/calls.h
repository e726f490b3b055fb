#pragma once

#include <cstdint>
#include <string_view>

namespace stellate::server {

// What is counted of gRPC's calls, each known by the address of gRPC's own object. gRPC's parts
// report here: those that replace gRPC 1.51's, or those that packaging/grpc/parts.patch changes.

// With a part of a request.
enum class WhatToDo { kTake, kCopy, kLetGo, kTooMuch };

inline constexpr std::int64_t kPrefixBytes = 5;  // before each message: its length

// A call begins on the connection of that socket. False: the connection is not counted.
bool CallBegins(const void* call, int fd);
void CallEnds(const void* call);
void HeadersHaveCome(const void* call, std::string_view path, std::string_view authorization);
WhatToDo PartComes(const void* call, std::int64_t bytes);
// A request is whole and reaches the server: as many bytes as came of it, kPrefixBytes among them.
void RequestLeaves(const void* call, std::int64_t bytes);

}  // namespace stellate::server
