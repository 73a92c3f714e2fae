# `cmake --install` gives the library, its headers and the CMake package: find_package(diffnea), diffnea::diffnea.
include(CMakePackageConfigHelpers)

set(_package_folder "${CMAKE_INSTALL_LIBDIR}/cmake/diffnea")

install(TARGETS diffnea EXPORT diffneaTargets ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}"
        LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
set_target_properties(diffnea PROPERTIES INSTALL_RPATH "$ORIGIN")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/diffnea" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.hpp")
install(FILES "${PROJECT_BINARY_DIR}/include/diffnea/version.hpp"
        DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/diffnea")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/models/" DESTINATION "${CMAKE_INSTALL_DATADIR}/diffnea/models")
install(EXPORT diffneaTargets NAMESPACE diffnea:: DESTINATION "${_package_folder}")

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
        DESTINATION "${_package_folder}")
