# Read by gRPC's own CMakeLists.txt after its project(): what is changed about its targets, without
# touching its files. xDS, by which others configure the servers of a mesh of services, is left out: nobody
# here speaks it, and it is half of the sources. The headers that nearly all of the rest reads are read
# once, and sources compiled ten at a time: in a third of the time.
function(stellate_lean)
  # Debian's plugin for Debian's protoc: the newer one wants a newer protoc, and 1.56 takes what 1.51 writes.
  find_program(plugin grpc_cpp_plugin REQUIRED)
  add_executable(grpc_cpp_plugin IMPORTED)
  set_target_properties(grpc_cpp_plugin PROPERTIES IMPORTED_LOCATION "${plugin}")
  get_target_property(sources grpc SOURCES)
  list(FILTER sources EXCLUDE REGEX
    "upbdefs-generated/|upb-generated/(envoy|opencensus|udpa|validate|google/api|xds/(annotations|core|type))/")
  list(FILTER sources EXCLUDE REGEX
    "/(lb_policy|resolver|ext|credentials)/xds/|/filters/(rbac|stateful_session)/|google_c2p|ring_hash")
  set_target_properties(grpc PROPERTIES SOURCES "${sources}")
  target_compile_definitions(grpc PRIVATE GRPC_NO_XDS)
  get_target_property(sources grpc++ SOURCES)
  list(FILTER sources EXCLUDE REGEX "/xds_(server_)?credentials")
  set_target_properties(grpc++ PROPERTIES SOURCES "${sources}")
  set(core "${PROJECT_SOURCE_DIR}/src/core")
  foreach(header
      ext/transport/chttp2/transport/internal.h
      lib/security/credentials/credentials.h
      lib/channel/promise_based_filter.h
      lib/json/json_object_loader.h)
    target_precompile_headers(grpc PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:${core}/${header}>")
  endforeach()
  target_precompile_headers(grpc++ PRIVATE
    "$<$<COMPILE_LANGUAGE:CXX>:${PROJECT_SOURCE_DIR}/include/grpcpp/grpcpp.h>")
  foreach(target grpc grpc++)
    stellate_together(${target})
  endforeach()
endfunction()

# Sources far apart: neighbours have the same names for what is their own.
function(stellate_together target)
  get_target_property(sources ${target} SOURCES)
  set(together ${sources})
  list(FILTER together INCLUDE REGEX "\\.cc$")
  list(FILTER together EXCLUDE REGEX "/rbac_policy\\.cc$")  # so that those fall together that were tried
  list(LENGTH together count)
  math(EXPR groups "(${count} + 9) / 10")
  set(at 0)
  foreach(source ${together})
    math(EXPR group "${at} % ${groups}")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${target}_${group})
    math(EXPR at "${at} + 1")
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()
cmake_language(DEFER CALL stellate_lean)
