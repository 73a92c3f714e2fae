# Defines mujoco::mujoco.
#
# An installed MuJoCo (2.2.2 or later) wins. Otherwise the C library and the headers are taken from the wheel on the
# package index, which pip downloads (so pip's own configuration decides where from) and a SHA-256 checks. The wheel
# is kept in the user's cache folder, so that a second build folder needs no network.
#
#   DIFFNEA_MUJOCO_WHEEL   a wheel that you have downloaded yourself
#
# Sets DIFFNEA_MUJOCO_LIBRARY and DIFFNEA_MUJOCO_LICENSE to the files that have to be installed with our library; both
# are empty for an installed MuJoCo.

set(DIFFNEA_MUJOCO_WHEEL "" CACHE FILEPATH "MuJoCo wheel to use instead of a download")
set(DIFFNEA_MUJOCO_LIBRARY "")
set(DIFFNEA_MUJOCO_LICENSE "")
set(_mujoco_version 2.2.2)

if(NOT DIFFNEA_MUJOCO_WHEEL)
  find_package(mujoco ${_mujoco_version} CONFIG QUIET)
  if(mujoco_FOUND)
    # Debian's package names an include folder that exists only with libqhull-dev; CMake refuses such a target.
    get_target_property(_includes mujoco::mujoco INTERFACE_INCLUDE_DIRECTORIES)
    set(_existing "")
    foreach(_folder IN LISTS _includes)
      if(_folder MATCHES "^\\$<" OR EXISTS "${_folder}")
        list(APPEND _existing "${_folder}")
      endif()
    endforeach()
    set_target_properties(mujoco::mujoco PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_existing}")
    message(STATUS "MuJoCo ${mujoco_VERSION}: ${mujoco_DIR}")
    return()
  endif()
endif()

if(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
  set(_arch x86_64)
  set(_sha256 a074ea3d63ecc504367df46aa73b3066cd9e7d7ebfe8a48261fba04a9ca232ea)
elseif(CMAKE_SYSTEM_NAME STREQUAL "Linux" AND CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  set(_arch aarch64)
  set(_sha256 ea42cb51e69e9001a71d8a26408288772cf3450a0e8cc5de99d7fa1c5a81584a)
else()
  message(FATAL_ERROR
    "MuJoCo: not installed, and no wheel of ${_mujoco_version} is known for ${CMAKE_SYSTEM_NAME} ${CMAKE_SYSTEM_PROCESSOR}. "
    "Install MuJoCo and pass -Dmujoco_DIR=<folder of mujocoConfig.cmake>.")
endif()
set(_wheel_name "mujoco-${_mujoco_version}-cp310-cp310-manylinux_2_17_${_arch}.manylinux2014_${_arch}.whl")
set(_download_args mujoco==${_mujoco_version} --only-binary=:all: --no-deps --implementation cp
    --python-version 3.10 --platform manylinux2014_${_arch})

function(_diffnea_download_mujoco folder)
  find_package(Python COMPONENTS Interpreter QUIET)
  set(reason "no Python interpreter was found")
  if(Python_Interpreter_FOUND)
    message(STATUS "MuJoCo ${_mujoco_version}: downloading the wheel with pip")
    execute_process(
      COMMAND "${Python_EXECUTABLE}" -m pip download ${_download_args} --quiet --dest "${folder}"
      RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(result EQUAL 0)
      return()
    endif()
    set(reason "${Python_EXECUTABLE} -m pip failed:\n${output}")
  endif()
  list(JOIN _download_args " " arguments)
  message(FATAL_ERROR
    "MuJoCo ${_mujoco_version} is neither installed nor downloadable: ${reason}\n"
    "Do one of these:\n"
    "  - give pip a package index that it can reach (pip config, PIP_INDEX_URL) and configure again;\n"
    "  - on a connected machine run\n      python3 -m pip download ${arguments}\n"
    "    and pass -DDIFFNEA_MUJOCO_WHEEL=<the file>;\n"
    "  - install MuJoCo ${_mujoco_version} or later and pass -Dmujoco_DIR=<folder of mujocoConfig.cmake>.")
endfunction()

set(_wheel "${DIFFNEA_MUJOCO_WHEEL}")
if(NOT _wheel)
  if(DEFINED ENV{XDG_CACHE_HOME})
    set(_cache "$ENV{XDG_CACHE_HOME}/diffnea")
  elseif(DEFINED ENV{HOME})
    set(_cache "$ENV{HOME}/.cache/diffnea")
  else()
    set(_cache "${CMAKE_BINARY_DIR}/_deps")
  endif()
  set(_wheel "${_cache}/${_wheel_name}")
  if(NOT EXISTS "${_wheel}")
    _diffnea_download_mujoco("${_cache}")
  endif()
endif()

file(SHA256 "${_wheel}" _found_sha256)
if(NOT _found_sha256 STREQUAL _sha256)
  message(FATAL_ERROR
    "MuJoCo: ${_wheel} has SHA-256 ${_found_sha256}, expected ${_sha256}. Delete the file and configure again.")
endif()

set(_mujoco_root "${CMAKE_BINARY_DIR}/_deps/mujoco-${_mujoco_version}")
set(DIFFNEA_MUJOCO_LIBRARY "${_mujoco_root}/mujoco/libmujoco.so.${_mujoco_version}")
set(DIFFNEA_MUJOCO_LICENSE "${_mujoco_root}/mujoco-${_mujoco_version}.dist-info/LICENSE")
if(NOT EXISTS "${DIFFNEA_MUJOCO_LIBRARY}")
  file(ARCHIVE_EXTRACT INPUT "${_wheel}" DESTINATION "${_mujoco_root}"
       PATTERNS "mujoco/include/*" "mujoco/libmujoco*" "mujoco-*.dist-info/LICENSE*")
endif()

add_library(mujoco::mujoco SHARED IMPORTED GLOBAL)
set_target_properties(mujoco::mujoco PROPERTIES
  IMPORTED_LOCATION "${DIFFNEA_MUJOCO_LIBRARY}"
  IMPORTED_SONAME "libmujoco.so.${_mujoco_version}"
  INTERFACE_INCLUDE_DIRECTORIES "${_mujoco_root}/mujoco/include")
message(STATUS "MuJoCo ${_mujoco_version}: ${_wheel_name}")
