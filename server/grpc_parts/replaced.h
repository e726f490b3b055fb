#pragma once

#include <dlfcn.h>

namespace stellate::server {

// gRPC's own function of that name, where a function of this program has replaced it. A member
// function takes its object first.
template <typename Function>
Function* Original(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

// Whether the name leads gRPC to this program, and from there on to gRPC.
inline bool IsReplaced(const char* name) {
  void* const original = dlsym(RTLD_NEXT, name);
  return original != nullptr && original != dlsym(RTLD_DEFAULT, name);
}

}  // namespace stellate::server
