# stellate_shared_constants(HEADER TOML NAMESPACE): writes a C++ header with the values of a file of
# clients/shared, the part of TOML that they are written in: a key and a value a line, arrays of one
# type over several lines perhaps, tables of words, comments.
#
#   least_size = 1e-45      inline constexpr double kLeastSize = 1e-45;
#   batches = [1, 10]       inline constexpr int kBatches[] = {1, 10};
#   laws = ["a", "b"]       inline constexpr const char* kLaws[] = {"a", "b"};
#   [reasons]
#   NO_SEEDS = "Oracle"     inline constexpr Entry kReasons[] = {{"NO_SEEDS", "Oracle"}, ...};

function(stellate_shared_constants header toml namespace)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${toml})
  file(READ ${toml} text)
  string(REGEX REPLACE "[ ]*#[^\n]*" "" text "${text}")
  string(REGEX REPLACE "\n(\\[[a-z_]+\\])\n" "\n\\1 =\n" text "${text}")
  # Lists of CMake's take neither brackets nor semicolons.
  string(REPLACE "[" "<" text "${text}")
  string(REPLACE "]" ">" text "${text}")
  set(declarations "")
  set(table "")
  while(text MATCHES "^[ \n]*(<?[A-Za-z_0-9]+>?) =[ \n]?(<[^>]*>|[^\n<]*)(.*)$")
    set(key "${CMAKE_MATCH_1}")
    set(value "${CMAKE_MATCH_2}")
    set(text "${CMAKE_MATCH_3}")
    if(key MATCHES "^<(.*)>$")
      stellate_constant_name(name ${CMAKE_MATCH_1})
      if(table)
        string(APPEND declarations "};\n")
      endif()
      string(APPEND declarations "inline constexpr Entry ${name}[] = {\n")
      set(table ${name})
      set(text "${value}${text}")
    elseif(table)
      string(APPEND declarations "    {\"${key}\", ${value}},\n")
    else()
      stellate_constant_name(name ${key})
      string(REGEX REPLACE "^<[ \n]*(.*[^, \n]),?[ \n]*>$" "\\1" elements "${value}")
      set(type int)
      if(elements MATCHES "^\"")
        set(type "const char*")
      elseif(elements MATCHES "[.e]")
        set(type double)
      endif()
      if(value MATCHES "^<")
        string(APPEND declarations "inline constexpr ${type} ${name}[] = {${elements}};\n")
      else()
        string(APPEND declarations "inline constexpr ${type} ${name} = ${elements};\n")
      endif()
    endif()
  endwhile()
  if(text MATCHES "[^ \n]")
    message(FATAL_ERROR "${toml} is beyond this reader from here on: ${text}")
  endif()
  if(table)
    string(APPEND declarations "};\n")
  endif()
  get_filename_component(source ${toml} NAME)
  file(CONFIGURE OUTPUT ${header} @ONLY CONTENT "// From clients/shared/${source}.
#pragma once

namespace ${namespace} {

struct Entry {
  const char *key, *value;
};

${declarations}
}  // namespace ${namespace}
")
endfunction()

# Writes a C++ header with the text of a file of clients/shared as a constant of that name.
function(stellate_shared_text header file namespace name)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(READ ${file} text)
  get_filename_component(source ${file} NAME)
  file(CONFIGURE OUTPUT ${header} @ONLY CONTENT "// From clients/shared/${source}.
#pragma once

namespace ${namespace} {

inline constexpr char ${name}[] = R\"text(${text})text\";

}  // namespace ${namespace}
")
endfunction()

# max_meshes -> kMaxMeshes
function(stellate_constant_name result key)
  string(REPLACE "_" ";" words ${key})
  set(name k)
  foreach(word ${words})
    string(SUBSTRING ${word} 0 1 first)
    string(SUBSTRING ${word} 1 -1 rest)
    string(TOUPPER ${first} first)
    string(APPEND name ${first}${rest})
  endforeach()
  set(${result} ${name} PARENT_SCOPE)
endfunction()
