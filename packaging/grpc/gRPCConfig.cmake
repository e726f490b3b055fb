# gRPC as packaging/grpc/build made it: what CMake's find_package reads there.
include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(OpenSSL)
find_dependency(ZLIB)
find_dependency(absl CONFIG)
find_dependency(Protobuf)
find_library(gRPC_CARES_LIBRARY cares REQUIRED)
find_library(gRPC_RE2_LIBRARY re2 REQUIRED)

set(gRPC_VERSION @version@)
get_filename_component(root "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
function(grpc_library name)  # NAME LIBRARY...: what it links
  add_library(gRPC::${name} STATIC IMPORTED)
  set_target_properties(gRPC::${name} PROPERTIES
    IMPORTED_LOCATION "${root}/lib/lib${name}.a"
    INTERFACE_INCLUDE_DIRECTORIES "${root}/include"
    INTERFACE_LINK_LIBRARIES "${ARGN}")
endfunction()
set(abseil any_invocable base bind_front cleanup cord core_headers flags flags_marshalling flat_hash_map
  flat_hash_set function_ref hash inlined_vector memory optional random_random span status statusor
  str_format strings synchronization time type_traits utility variant)
list(TRANSFORM abseil PREPEND absl::)
grpc_library(gpr ${abseil} Threads::Threads m rt)
grpc_library(address_sorting)
grpc_library(upb m)
grpc_library(grpc gRPC::gpr gRPC::address_sorting gRPC::upb OpenSSL::SSL OpenSSL::Crypto ZLIB::ZLIB
  ${gRPC_CARES_LIBRARY} ${gRPC_RE2_LIBRARY} dl)
grpc_library(grpc++ gRPC::grpc protobuf::libprotobuf)
grpc_library(grpc++_reflection gRPC::grpc++)
