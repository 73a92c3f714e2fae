# Defines CeresJet::CeresJet: Ceres' header ceres/jet.h with what it includes, and no library.
#
# ceres/jet.h is a header of templates. Ceres::ceres would bring libceres to every user, and with it glog, BLAS and, in
# most builds, SuiteSparse, parts of which are GPL. A source file that solves with Ceres links Ceres::ceres PRIVATE.
#
#   CeresJet_INCLUDE_DIR   the folder that holds ceres/jet.h
include(FindPackageHandleStandardArgs)

find_path(CeresJet_INCLUDE_DIR ceres/jet.h HINTS "${Ceres_DIR}/../../../include")
mark_as_advanced(CeresJet_INCLUDE_DIR)
set(CeresJet_VERSION "")
if(CeresJet_INCLUDE_DIR)
  file(STRINGS "${CeresJet_INCLUDE_DIR}/ceres/version.h" _lines REGEX "#define CERES_VERSION_(MAJOR|MINOR|REVISION) ")
  string(REGEX REPLACE "[^0-9;]" "" _numbers "${_lines}")
  list(JOIN _numbers "." CeresJet_VERSION)
endif()
find_package_handle_standard_args(CeresJet REQUIRED_VARS CeresJet_INCLUDE_DIR VERSION_VAR CeresJet_VERSION)

if(CeresJet_FOUND AND NOT TARGET CeresJet::CeresJet)
  add_library(CeresJet::CeresJet INTERFACE IMPORTED)
  set_target_properties(CeresJet::CeresJet PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${CeresJet_INCLUDE_DIR}")
endif()
