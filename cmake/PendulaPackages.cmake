# Debian packages: `cpack` in the build folder of the preset `package` writes pendula_….deb, the program,
# libpendula0_….deb, the shared library for C, and libpendula-dev_….deb, the library. scripts/deb makes some that later
# releases can install, too.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME pendula)
set(CPACK_PACKAGE_VENDOR pendula)
set(CPACK_PACKAGE_CONTACT "pendula contributors <pendula@example.org>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program system shared devel)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_COMPONENT_PROGRAM_GROUP program)
set(CPACK_COMPONENT_SYSTEM_GROUP program)
set(CPACK_COMPONENT_SHARED_GROUP shared)
set(CPACK_COMPONENT_DEVEL_GROUP devel)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME pendula)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS "python3-venv, g++, libeigen3-dev, libxsimd-dev")  # for models: share/pendula/setup
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "The program: pendulums of few and of many links, in the plane and in space, and any mechanical system with a Lagrangian;\n\
events, exponents, derivatives, ensembles, pages. Models of one's own and pictures take what\n\
/usr/share/pendula/setup installs.")
set(shared_package "libpendula${PENDULA_C_INTERFACE}")
set(CPACK_DEBIAN_SHARED_PACKAGE_NAME "${shared_package}")
set(CPACK_DEBIAN_SHARED_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_SHARED_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_SHARED_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_COMPONENT_SHARED_DESCRIPTION "For programs that use pendula from C: the shared library.")
set(CPACK_DEBIAN_DEVEL_PACKAGE_NAME libpendula-dev)
set(CPACK_DEBIAN_DEVEL_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVEL_PACKAGE_DEPENDS "pendula (= ${PROJECT_VERSION}), ${shared_package} (= ${PROJECT_VERSION}), libeigen3-dev, libxsimd-dev")
set(CPACK_DEBIAN_DEVEL_PACKAGE_SUGGESTS "cmake, g++")
set(CPACK_COMPONENT_DEVEL_DESCRIPTION "For C++ and C: library, headers, packages for CMake and pkg-config.\n\
Kernels that SymPy derives, and the integrators that move them.")

# What models were installed with is no package's: it goes with the program.
set(clean_up "${PROJECT_BINARY_DIR}/packages/postrm")
file(WRITE "${clean_up}" "#!/bin/sh\nset -e\nif [ \"$1\" = remove ] || [ \"$1\" = purge ]; then rm -rf /usr/share/pendula/venv; fi\n")
file(CHMOD "${clean_up}" PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA "${clean_up}")

include(PendulaLicences)
pendula_install_licences("${CMAKE_INSTALL_DATADIR}/doc/pendula/licences" COMPONENT system)
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/libpendula-dev" RENAME copyright)
if(TARGET pendula_c)
  install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/${shared_package}"
          RENAME copyright COMPONENT shared)
endif()
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DATADIR}/doc/pendula" RENAME copyright
        COMPONENT system)

include(CPack)
