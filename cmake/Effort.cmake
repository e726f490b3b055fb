# stellate_effort(TARGET OPTION...): how hard the compiler works on a target in builds of type Release,
# which are -O3 otherwise. The loops that meshes spend their time in keep that; elsewhere -O3 takes a
# third of the build's time and saves none of a mesh's.
function(stellate_effort target)
  target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:${ARGN}>")
endfunction()
