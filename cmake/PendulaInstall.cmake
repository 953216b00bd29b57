# What an install holds: the library, its headers with the kernels of this build, the shared library for C, the generator
# for more kernels, the program with its pictures, scenarios, manual page and completion for shells, the script that
# installs what these take, and the packages for CMake and pkg-config. Its components: `program`, what the wheel of the
# Python package holds, too; `system`, the rest of what the program takes; `shared`, what programs in C need to run;
# `devel`, all else.
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME devel)

set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/pendula")
set(codegen_dir "${CMAKE_INSTALL_DATADIR}/pendula/codegen")

install(TARGETS pendula_kernels pendula EXPORT pendulaTargets FILE_SET HEADERS)
if(TARGET pendula_c)
  install(TARGETS pendula_c EXPORT pendulaTargets LIBRARY COMPONENT shared NAMELINK_COMPONENT devel
          INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
  cmake_path(RELATIVE_PATH PROJECT_SOURCE_DIR BASE_DIRECTORY "${PROJECT_SOURCE_DIR}/${CMAKE_INSTALL_LIBDIR}/pkgconfig" OUTPUT_VARIABLE to_prefix)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/pendula.pc.in" "${PROJECT_BINARY_DIR}/pendula.pc" @ONLY)
  install(FILES "${PROJECT_BINARY_DIR}/pendula.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
endif()
install(EXPORT pendulaTargets NAMESPACE pendula:: DESTINATION "${package_dir}")
if(PENDULA_BUILD_PROGRAM)
  set(data_dir "${CMAKE_INSTALL_DATADIR}/pendula")
  install(TARGETS pendula_cli COMPONENT program)
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/plotting" DESTINATION "${data_dir}" COMPONENT program
          PATTERN "__pycache__" EXCLUDE)
  install(PROGRAMS "${PROJECT_SOURCE_DIR}/cmake/installed_setup" DESTINATION "${data_dir}" RENAME setup COMPONENT system)
  install(DIRECTORY "${PROJECT_BINARY_DIR}/share/" DESTINATION "${CMAKE_INSTALL_DATADIR}" COMPONENT program)  # by describe_program.cmake
  install(DIRECTORY "${PROJECT_SOURCE_DIR}/examples" DESTINATION "${data_dir}" COMPONENT program FILES_MATCHING PATTERN "*.toml")
endif()

install(DIRECTORY "${PENDULA_CODEGEN_DIR}/pendula_codegen" DESTINATION "${codegen_dir}" COMPONENT program
        FILES_MATCHING PATTERN "*.py" PATTERN "*.j2" PATTERN "__pycache__" EXCLUDE)
install(FILES "${PENDULA_CODEGEN_DIR}/requirements.txt" DESTINATION "${codegen_dir}" COMPONENT program)

configure_package_config_file(
  "${PROJECT_SOURCE_DIR}/cmake/pendulaConfig.cmake.in" "${PROJECT_BINARY_DIR}/package/pendulaConfig.cmake"
  INSTALL_DESTINATION "${package_dir}" PATH_VARS CMAKE_INSTALL_INCLUDEDIR codegen_dir)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/package/pendulaConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
# Not in the build folder itself, which find_package would take for an installed one where its bin/ is in PATH.
install(FILES "${PROJECT_BINARY_DIR}/package/pendulaConfig.cmake" "${PROJECT_BINARY_DIR}/package/pendulaConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/PendulaKernels.cmake" "${PROJECT_SOURCE_DIR}/cmake/PendulaPython.cmake"
              "${PROJECT_SOURCE_DIR}/cmake/PendulaXsimd.cmake" "${PROJECT_SOURCE_DIR}/cmake/check_requirements.py"
        DESTINATION "${package_dir}")
