# What may be there or not is looked for at each configuration: cmake -D SOURCE=… -D BUILD=… -P optional_packages.cmake
# The demo configures before the tests' packages are installed, in the same build folder.
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE "${BUILD}")

# expect(TRUTH ARGUMENT...): whether the program knows MPI where it is configured like that.
function(expect truth)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${SOURCE}" -B "${BUILD}" -G Ninja -D PENDULA_BUILD_TESTS=OFF ${ARGN}
                  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
  file(STRINGS "${BUILD}/build.ninja" found REGEX "DEFINES = .*-DPENDULA_MPI")
  if(found AND NOT truth OR truth AND NOT found)
    message(FATAL_ERROR "${ARGN}: expected a program with MPI: ${truth}, got the opposite")
  endif()
endfunction()

set(installed -U CMAKE_DISABLE_FIND_PACKAGE_MPI)
expect(OFF -D CMAKE_DISABLE_FIND_PACKAGE_MPI=ON)
expect(ON ${installed})
expect(OFF -D PENDULA_MPI=OFF)
expect(OFF)
expect(ON -U PENDULA_MPI)
