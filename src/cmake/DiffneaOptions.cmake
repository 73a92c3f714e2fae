# What to build, and the compiler settings that every target of ours shares.

# Components of the library, each on top of the one before; the chosen one is the highest that is built.
set(DIFFNEA_COMPONENTS dynamics identify sim diffnea)
set(DIFFNEA_COMPONENT diffnea CACHE STRING "Highest component to build: dynamics, identify, sim or diffnea (all)")
set_property(CACHE DIFFNEA_COMPONENT PROPERTY STRINGS ${DIFFNEA_COMPONENTS})
list(FIND DIFFNEA_COMPONENTS "${DIFFNEA_COMPONENT}" _highest)
if(_highest LESS 0)
  message(FATAL_ERROR "DIFFNEA_COMPONENT is '${DIFFNEA_COMPONENT}'; choices: dynamics, identify, sim, diffnea")
endif()
math(EXPR _count "${_highest} + 1")
list(SUBLIST DIFFNEA_COMPONENTS 0 ${_count} DIFFNEA_COMPONENTS)
# Command, module and tests are of the whole library.
set(_by_user OFF)
if(PROJECT_IS_TOP_LEVEL AND DIFFNEA_COMPONENT STREQUAL "diffnea")
  set(_by_user ON)
endif()

option(DIFFNEA_BUILD_APPS "Build the diffnea command" ${_by_user})
# SKBUILD is set by scikit-build-core, that is, by pip: it wants the module and, unless told, no tests.
if(SKBUILD)
  set(_by_pip ON)
  set(_by_cmake OFF)
else()
  set(_by_pip OFF)
  set(_by_cmake ${_by_user})
endif()
option(DIFFNEA_BUILD_PYTHON "Build the Python module" ${_by_pip})
option(DIFFNEA_BUILD_TESTS "Build the C++ tests (needs Catch2 v3)" ${_by_cmake})
option(DIFFNEA_BUILD_FUZZERS "Build the libFuzzer targets (needs clang; tests/fuzz/README.md)" OFF)
option(DIFFNEA_INSTALL "Install the library, its headers and its CMake package" ${PROJECT_IS_TOP_LEVEL})
option(DIFFNEA_WERROR "Treat warnings in our own sources as errors" OFF)
option(DIFFNEA_UNITY "Compile files of one folder together: a whole build takes a third of the time" ON)
set(DIFFNEA_SANITIZE "" CACHE STRING "Sanitizers for our own targets, e.g. address,undefined")

if(PROJECT_IS_TOP_LEVEL)
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
  endif()
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

  find_program(CCACHE_PROGRAM ccache)
  mark_as_advanced(CCACHE_PROGRAM)
  if(CCACHE_PROGRAM AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
    set(CMAKE_C_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
    set(CMAKE_CXX_COMPILER_LAUNCHER "${CCACHE_PROGRAM}")
  endif()

  # pip lives in the virtual environment when the system's Python has none.
  if(NOT DEFINED Python_EXECUTABLE AND EXISTS "${PROJECT_SOURCE_DIR}/.venv/bin/python")
    set(Python_EXECUTABLE "${PROJECT_SOURCE_DIR}/.venv/bin/python")
  endif()
endif()

# Groups of a folder's files are compiled as one: what they include and instantiate is compiled once. Groups stay small,
# because touching one file compiles its whole group: 32 kB of sources take some ten seconds, of bindings thrice that.
# Names in anonymous namespaces must differ within a folder.
function(diffnea_compile_together target most_bytes)
  if(NOT DIFFNEA_UNITY)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  set(group 0)
  set(bytes 0)
  foreach(source IN LISTS ARGN)
    get_filename_component(folder "${source}" DIRECTORY)
    string(REPLACE "/" "_" folder "${folder}")
    file(SIZE "${CMAKE_CURRENT_SOURCE_DIR}/${source}" size)
    math(EXPR bytes "${bytes} + ${size}")
    if(bytes GREATER most_bytes)
      math(EXPR group "${group} + 1")
      set(bytes ${size})
    endif()
    set_property(SOURCE "${source}" PROPERTY UNITY_GROUP "${folder}_${group}")
  endforeach()
endfunction()

# For targets that compute nothing in loops (commands, bindings, pages): compiling them takes a fifth less.
function(diffnea_not_hot target)
  target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:-O1>")
endfunction()

# Language level, position independence, warnings and sanitizers. All of it is private to `target`: a user's
# target that links diffnea inherits none but the language level.
function(diffnea_target_defaults target)
  set_target_properties(${target} PROPERTIES
    CXX_EXTENSIONS OFF
    POSITION_INDEPENDENT_CODE ON
    VISIBILITY_INLINES_HIDDEN ON)
  target_compile_features(${target} PUBLIC cxx_std_20)
  # -Wsign-conversion stays off: Eigen's indices are signed, the standard library's are not.
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor -Woverloaded-virtual
    -Wextra-semi -Wcast-align -Wformat=2)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # gcc reports these inside inlined Eigen and std::vector code that is correct: shown, never fatal.
    target_compile_options(${target} PRIVATE
      -Wduplicated-cond -Wlogical-op
      -Wno-error=maybe-uninitialized -Wno-error=array-bounds -Wno-error=stringop-overflow)
    if(CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
      target_compile_options(${target} PRIVATE -Wno-restrict)  # GCC bug 105651: std::string's operator+
    endif()
  endif()
  if(DIFFNEA_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(DIFFNEA_SANITIZE)
    target_compile_options(${target} PRIVATE
      -fsanitize=${DIFFNEA_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${DIFFNEA_SANITIZE})
  endif()
endfunction()
