# stellate_effort(TARGET OPTION...): how hard the compiler works on a target in builds of type Release,
# which are -O3 otherwise. No target needs all of -O3: the loops that meshes spend their time in are
# as fast with -O2 and its inlining, and elsewhere -O3 takes a third of the build's time and saves
# none of a mesh's.
function(stellate_effort target)
  target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:${ARGN}>")
endfunction()

# GCC looks for memory to take back from 512 MiB on, not from 128 MiB: a twelfth of its time.
if(PROJECT_IS_TOP_LEVEL AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(--param=ggc-min-heapsize=524288)
endif()
