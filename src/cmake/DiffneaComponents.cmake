# The compiled components, a library each, one on top of the other: dynamics (headers alone), identify, sim, diffnea.
#
#   diffnea_component(<name> ON <component below>)   makes diffnea::<name>, where DIFFNEA_COMPONENT asks for it
#   diffnea_sources(<name> [ALONE] <file> ...)       compiles files of one folder into it, several at a time unless ALONE
#
# The target of component `diffnea` is `diffnea`, those of the others are `diffnea_<name>`.

function(diffnea_component name)
  cmake_parse_arguments(PARSE_ARGV 1 _arg "" ON "")
  list(FIND DIFFNEA_COMPONENTS ${name} _wanted)
  if(_wanted LESS 0)
    return()
  endif()
  set(target diffnea_${name})
  if(name STREQUAL "diffnea")
    set(target diffnea)
  endif()
  add_library(${target})
  add_library(diffnea::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  diffnea_target_defaults(${target})
  target_include_directories(${target} PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}")
  target_link_libraries(${target} PUBLIC diffnea_${_arg_ON})
endfunction()

function(diffnea_sources name)
  cmake_parse_arguments(PARSE_ARGV 1 _arg "ALONE" "" "")
  set(target diffnea_${name})
  if(name STREQUAL "diffnea")
    set(target diffnea)
  endif()
  if(NOT TARGET ${target})
    return()
  endif()
  target_sources(${target} PRIVATE ${_arg_UNPARSED_ARGUMENTS})
  if(NOT _arg_ALONE)
    diffnea_compile_together(${target} 32000 ${_arg_UNPARSED_ARGUMENTS})
  endif()
endfunction()
