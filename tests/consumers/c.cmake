# Projects in C that know nothing but an installed pendula: two systems exported into its own build; and the examples in C
# and Rust, which use the shared library.
include("${CMAKE_CURRENT_LIST_DIR}/steps.cmake")

take_project(c)
list(APPEND configure -D "CMAKE_PREFIX_PATH=${prefix}")
step(${configure})
step(${build})
step("${project}-build/step")
message(STATUS "${output}")
require_no_path_of_checkout("${project}-build")

foreach(case IN ITEMS "step SPACE planar LINKS 2 LANGUAGE Ada|expected the LANGUAGE CXX or C, got \"Ada\"")
  string(REGEX MATCH "^([^|]*)\\|(.*)$" matched "${case}")
  step_fails("${CMAKE_MATCH_2}" ${configure} -D "EXTRA_ARGUMENTS=${CMAKE_MATCH_1}")
endforeach()

# Numbers of an example, and those of the command line.
function(compare scenario event printed)
  set(ENV{XDG_CACHE_HOME} "${BUILD}/models")
  step("${PYTHON}" -B "${SOURCE}/tests/consumers/compare.py" "${BUILD}/bin/pendula" "${SOURCE}/examples/${scenario}.toml" "${event}"
       "${printed}" "${WORK}" ${ARGN})
  message(STATUS "${output}")
endfunction()

# measured: numbers off by 3.6e-11, their change by 1.4e-7
function(compare_double_pendulum program)
  step("${program}")
  file(WRITE "${WORK}/double_pendulum.txt" "${output}")
  compare(double_pendulum "sin(theta_1 / 2)" "${WORK}/double_pendulum.txt" start.theta
          "[1.5707973267948966, 1.5707963267948966]" "[1.5707953267948966, 1.5707963267948966]")
endfunction()

# By CMake, without what C++ needs.
take_project("${SOURCE}/examples/c")
step(${configure} -D "CMAKE_PREFIX_PATH=${prefix}" -D CMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON
     -D "CMAKE_C_FLAGS=-Wall -Wextra -Wpedantic -Werror")
step(${build})
compare_double_pendulum("${project}-build/double_pendulum")

# By pkg-config.
find_program(pkg_config pkg-config)
if(pkg_config)
  file(GLOB packages "${prefix}/lib*/pkgconfig" "${prefix}/lib/*/pkgconfig")
  set(ENV{PKG_CONFIG_PATH} "${packages}")
  step("${pkg_config}" --cflags --libs pendula)
  separate_arguments(flags UNIX_COMMAND "${output}")
  step("${pkg_config}" --variable=libdir pendula)
  string(STRIP "${output}" libraries)
  step(cc -std=c99 "${project}/double_pendulum.c" -o "${WORK}/double_pendulum" ${flags} -lm "-Wl,-rpath,${libraries}")
  step("${WORK}/double_pendulum")
else()
  message(STATUS "not tried: pkg-config was not found")
endif()

# In Rust.
find_program(rustc rustc HINTS "$ENV{HOME}/.cargo/bin")
if(NOT rustc OR NOT pkg_config)
  message(STATUS "not tried: the example in Rust; rustc or pkg-config was not found")
  return()
endif()
set(ENV{PYTHONPATH} "${prefix}/share/pendula/codegen")
step("${PYTHON}" -B -m pendula_codegen program --model cart_chain --links 3 --as bytecode --output "${WORK}/cart_chain_3.program")
take_project("${SOURCE}/examples/rust")
step("${rustc}" --edition 2021 -D warnings -O "${project}/balance.rs" -o "${WORK}/balance" -L "${libraries}"
     -C "link-arg=-Wl,-rpath,${libraries}")
step("${WORK}/balance" "${WORK}/cart_chain_3.program")
file(WRITE "${WORK}/balance.txt" "${output}")
compare(balance "theta_1 - pi" "${WORK}/balance.txt") # measured: numbers off by 2.3e-13
step_fails("line 1: expected a program, got" "${WORK}/balance" "${project}/balance.rs")
