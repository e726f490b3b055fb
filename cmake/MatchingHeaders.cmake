# A program that was compiled with other headers than an archive's would crash. It does not link:
# stellate_match_headers(TARGET OUT HEADER...) gives TARGET a symbol with a name that the texts of these
# headers make, and OUT lines for the end of an installed header, which ask for that symbol.
function(stellate_match_headers target out)
  set(digests)
  foreach(header ${ARGN})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${header})
    file(SHA256 ${header} digest)
    string(APPEND digests ${digest})
  endforeach()
  string(SHA256 digest "${digests}")
  string(SUBSTRING ${digest} 0 16 digest)
  set(symbol ${target}_is_of_the_headers_${digest})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}_headers.cc)
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT
    "extern \"C\" {\nextern const char @symbol@;\nconst char @symbol@ = 0;\n}\n")
  target_sources(${target} PRIVATE ${source})
  set(${out} "
// Links with the archive that belongs to these headers, and with no other.
#ifndef ${symbol}_
#define ${symbol}_
extern \"C\" const char ${symbol};
namespace {
[[maybe_unused, gnu::used]] const char* const ${target}_headers = &${symbol};
}
#endif
" PARENT_SCOPE)
endfunction()
