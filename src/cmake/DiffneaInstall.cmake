# `cmake --install` gives the components' libraries, the headers and the CMake package: find_package(diffnea COMPONENTS …).
include(CMakePackageConfigHelpers)

set(_package_folder "${CMAKE_INSTALL_LIBDIR}/cmake/diffnea")

set_target_properties(diffnea_dynamics PROPERTIES EXPORT_NAME dynamics)
foreach(_component IN LISTS DIFFNEA_COMPONENTS)
  set(_target diffnea_${_component})
  if(_component STREQUAL "diffnea")
    set(_target diffnea)
  endif()
  # A file of targets each: what a component needs is sought only for who asks for it.
  install(TARGETS ${_target} EXPORT diffnea_${_component} ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}"
          LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
  if(NOT _component STREQUAL "dynamics")
    set_target_properties(${_target} PROPERTIES INSTALL_RPATH "$ORIGIN")
  endif()
  install(EXPORT diffnea_${_component} NAMESPACE diffnea:: FILE diffnea_${_component}.cmake
          DESTINATION "${_package_folder}")
endforeach()
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/diffnea" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.hpp")
install(FILES "${PROJECT_BINARY_DIR}/include/diffnea/version.hpp"
        DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/diffnea")
if(TARGET diffnea_sim)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/models/" DESTINATION "${CMAKE_INSTALL_DATADIR}/diffnea/models")
endif()

set(DIFFNEA_MUJOCO_FILE "")
if(DIFFNEA_MUJOCO_LIBRARY)
  get_filename_component(DIFFNEA_MUJOCO_FILE "${DIFFNEA_MUJOCO_LIBRARY}" NAME)
  install(FILES "${DIFFNEA_MUJOCO_LIBRARY}" DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  install(FILES "${DIFFNEA_MUJOCO_LICENSE}" DESTINATION "${CMAKE_INSTALL_DOCDIR}" RENAME libmujoco.LICENSE)
endif()

configure_package_config_file(cmake/diffneaConfig.cmake.in "${CMAKE_CURRENT_BINARY_DIR}/diffneaConfig.cmake"
  INSTALL_DESTINATION "${_package_folder}" PATH_VARS CMAKE_INSTALL_LIBDIR)
write_basic_package_version_file("${CMAKE_CURRENT_BINARY_DIR}/diffneaConfigVersion.cmake"
  COMPATIBILITY SameMinorVersion)
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/diffneaConfig.cmake" "${CMAKE_CURRENT_BINARY_DIR}/diffneaConfigVersion.cmake"
        "${CMAKE_CURRENT_SOURCE_DIR}/cmake/FindCeresJet.cmake"
        DESTINATION "${_package_folder}")
