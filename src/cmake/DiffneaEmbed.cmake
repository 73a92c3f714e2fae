# Puts text files into the library as strings.
#
#   diffnea_embed(<target> <namespace> <constant>=<file> ...)
#
# gives `extern const std::string_view <constant>` in <namespace>. Written when CMake runs, and again when a file changes.
function(diffnea_embed target namespace)
  set(code "#include <string_view>\n\nnamespace ${namespace} {\n\n")
  foreach(pair IN LISTS ARGN)
    string(REGEX MATCH "^([^=]+)=(.*)$" _ "${pair}")
    set(constant "${CMAKE_MATCH_1}")
    file(READ "${CMAKE_MATCH_2}" text)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${CMAKE_MATCH_2}")
    string(APPEND code "extern const std::string_view ${constant};\nconst std::string_view ${constant} = R\"EMBED(${text})EMBED\";\n\n")
  endforeach()
  string(APPEND code "}  // namespace ${namespace}\n")
  set(output "${CMAKE_CURRENT_BINARY_DIR}/${target}_embedded.cpp")
  file(CONFIGURE OUTPUT "${output}" CONTENT "@code@" @ONLY)
  target_sources(${target} PRIVATE "${output}")
  set_property(SOURCE "${output}" APPEND PROPERTY COMPILE_OPTIONS -Wno-overlength-strings)
endfunction()
