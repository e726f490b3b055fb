# What does not hold of units that read so much at once: one source's own types are in a unit of
# several, and g++ 12 is wrong about the library's strings where it sees them through many calls.
set(STELLATE_BUNCH_OPTIONS
  -Wno-subobject-linkage -Wno-array-bounds -Wno-restrict -Wno-stringop-overflow)

# stellate_bunch(TARGET): where CMAKE_UNITY_BUILD is on, sources are compiled at once with others of
# their folder, eight at most: those tools/tidy.py reads at once, too, so names do not meet.
function(stellate_bunch target)
  if(NOT CMAKE_UNITY_BUILD)
    return()
  endif()
  get_target_property(sources ${target} SOURCES)
  foreach(source ${sources})
    get_filename_component(folder ${source} ABSOLUTE)
    get_filename_component(folder ${folder} DIRECTORY)
    string(MAKE_C_IDENTIFIER "${folder}" folder)
    list(APPEND seen_${folder} ${source})
    list(LENGTH seen_${folder} count)
    math(EXPR bunch "(${count} - 1) / 8")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder}_${bunch})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
  target_compile_options(${target} PRIVATE ${STELLATE_BUNCH_OPTIONS})
endfunction()
